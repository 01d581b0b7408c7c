/** Of several things that take time, the one that was asked for last. */
export class Latest {
  private asked = 0;

  /** Takes note of a request; returns what tells whether it is still the last one. */
  ask(): () => boolean {
    const mine = ++this.asked;
    return () => mine === this.asked;
  }

  /** Lets go of what was asked for. */
  drop(): void {
    this.asked++;
  }
}
