/** How often something happens, over the last two seconds or so. */

const SPAN = 2;

export class Rate {
  private counts: [time: number, count: number][] = [];

  /** Takes note that it happened, some times, at a time in s. */
  add(now: number, count: number): void {
    this.counts.push([now, count]);
    while (this.counts.length > 1 && now - (this.counts[0]?.[0] ?? now) > SPAN) this.counts.shift();
  }

  /** Forgets what was. */
  reset(): void {
    this.counts = [];
  }

  /** Times a second; 0 while nothing is known. */
  get perSecond(): number {
    const [first] = this.counts;
    const last = this.counts.at(-1);
    if (!first || !last) return 0;
    const happened = this.counts.slice(1).reduce((sum, [, count]) => sum + count, 0);
    return last[0] > first[0] ? happened / (last[0] - first[0]) : 0;
  }
}
