/** The level of the last 20 seconds as a line. */

const SPAN = 20;
const LOWEST = 45;
const HIGHEST = 85;
const GRID = 10;

export class Trace {
  private readonly readings: [time: number, level: number][] = [];
  private now = 0;

  constructor(private readonly canvas: HTMLCanvasElement) {
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  /** Takes a level, dBA, `seconds` after the last one. */
  add(level: number, seconds: number): void {
    this.now += seconds;
    if (Number.isFinite(level)) this.readings.push([this.now, level]);
    const isOver = () => this.now - (this.readings[0]?.[0] ?? this.now) > SPAN;
    while (isOver()) this.readings.shift();
    this.draw();
  }

  private draw(): void {
    const { canvas } = this;
    const ratio = window.devicePixelRatio;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (
      canvas.width !== Math.round(width * ratio) ||
      canvas.height !== Math.round(height * ratio)
    ) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const context = canvas.getContext("2d");
    if (!context || !width) return;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    const style = getComputedStyle(canvas);
    const y = (level: number) => height * (1 - (level - LOWEST) / (HIGHEST - LOWEST));
    context.font = "11px system-ui, sans-serif";
    context.fillStyle = context.strokeStyle = style.getPropertyValue("--soft");
    context.globalAlpha = 0.5;
    for (let level = LOWEST + 5; level < HIGHEST; level += GRID) {
      context.fillRect(0, Math.round(y(level)), width, 1);
      context.fillText(`${level}`, 4, y(level) - 3);
    }
    context.globalAlpha = 1;
    context.strokeStyle = style.getPropertyValue("--accent");
    context.lineWidth = 2;
    context.beginPath();
    for (const [time, level] of this.readings) {
      context.lineTo(width * (1 - (this.now - time) / SPAN), y(level));
    }
    context.stroke();
  }
}
