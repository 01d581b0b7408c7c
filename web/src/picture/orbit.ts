/** Where the camera looks from: a place on a sphere around the robot, turned by hand or by keys. */

import { PerspectiveCamera, type Vector3 } from "three";

/** Azimuths, rad: robots walk along x. */
const FROM_THE_FRONT = -0.9;
const FROM_BEHIND = -2.3;

/** Lowest and highest elevation, rad, and distances, m. */
const ELEVATIONS = [-0.05, 1.4] as const;
const DISTANCES = [0.8, 6] as const;

/** Angles that a pixel of a drag is, rad, and a pixel of the wheel, as a logarithm of the distance. */
const AROUND = 0.008;
const UP = 0.006;
const AWAY = 0.001;

export class Orbit {
  readonly camera = new PerspectiveCamera(40, 1, 0.05, 100);
  private azimuth = FROM_THE_FRONT;
  private elevation = 0.3;
  private distance = 1.9;

  constructor() {
    this.camera.up.set(0, 0, 1);
  }

  /** Where it is: rad, rad and m. */
  get place() {
    const { azimuth, elevation, distance } = this;
    return { azimuth, elevation, distance };
  }

  /** Turns by angles, rad, and goes away by the logarithm of a factor. */
  turn(around: number, up: number, away: number): void {
    this.azimuth += around;
    this.elevation = clamp(this.elevation + up, ELEVATIONS);
    this.distance = clamp(this.distance * Math.exp(away), DISTANCES);
  }

  /** Goes where one sees what lies ahead: on stairs behind the robot, else before it. */
  lookAhead(stairs: boolean): void {
    this.azimuth = stairs ? FROM_BEHIND : FROM_THE_FRONT;
  }

  /** Looks at a place. */
  lookAt(target: Vector3): void {
    const { azimuth, elevation, distance, camera } = this;
    const level = distance * Math.cos(elevation);
    camera.position.set(
      target.x + level * Math.cos(azimuth),
      target.y + level * Math.sin(azimuth),
      Math.max(target.z + distance * Math.sin(elevation), 0.1),
    );
    camera.lookAt(target);
  }

  /** Dragging turns it, the wheel brings it nearer. */
  listen(canvas: HTMLCanvasElement): void {
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (!canvas.hasPointerCapture(event.pointerId)) return;
      this.turn(-AROUND * event.movementX, UP * event.movementY, 0);
    });
    canvas.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        this.turn(0, 0, AWAY * event.deltaY);
      },
      { passive: false },
    );
  }
}

function clamp(value: number, [low, high]: readonly [number, number]): number {
  return Math.min(Math.max(value, low), high);
}
