/** Returns what an error says, in words for the visitor. */
export function messageOf(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}
