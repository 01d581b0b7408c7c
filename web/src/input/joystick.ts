/** A stick to be pulled by finger or mouse: where it is, in shares of its reach. */

/** Where a stick is pulled: `forward` and `left` from -1 to 1; both 0 where it is let go. */
export type StickListener = (forward: number, left: number) => void;

/** Within this share of the reach a stick counts as let go. */
const SLACK = 0.12;

/** Makes an element with a child, the knob, into a stick. */
export function makeJoystick(pad: HTMLElement, knob: HTMLElement, listener: StickListener): void {
  let pointer: number | null = null;
  const move = (event: PointerEvent) => {
    const box = pad.getBoundingClientRect();
    const reach = 0.5 * box.width;
    let x = (event.clientX - box.left - reach) / reach;
    let y = (event.clientY - box.top - 0.5 * box.height) / reach;
    const length = Math.max(1, Math.hypot(x, y));
    [x, y] = [x / length, y / length];
    knob.style.transform = `translate(${0.7 * x * reach}px, ${0.7 * y * reach}px)`;
    listener(withoutSlack(-y), withoutSlack(-x));
  };
  const end = (event: PointerEvent) => {
    if (event.pointerId !== pointer) return;
    pointer = null;
    knob.style.transform = "";
    listener(0, 0);
  };
  pad.addEventListener("pointerdown", (event) => {
    if (pointer !== null) return;
    pointer = event.pointerId;
    pad.setPointerCapture(event.pointerId);
    move(event);
    event.preventDefault();
  });
  pad.addEventListener("pointermove", (event) => {
    if (event.pointerId === pointer) move(event);
  });
  pad.addEventListener("pointerup", end);
  pad.addEventListener("pointercancel", end);
}

/** Returns how far a stick is pulled, without what a hand does not mean. */
export function withoutSlack(share: number): number {
  const beyond = (Math.abs(share) - SLACK) / (1 - SLACK);
  return beyond > 0 ? Math.sign(share) * Math.min(beyond, 1) : 0;
}
