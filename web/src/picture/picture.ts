/**
 * The picture: the robot on its ground, a light that follows it, and a camera to be turned by hand.
 *
 * The robot is drawn between its last two control steps, so that it moves smoothly at any frame rate.
 */

import {
  AmbientLight,
  Color,
  DirectionalLight,
  Fog,
  HemisphereLight,
  type Object3D,
  PCFShadowMap,
  Quaternion,
  Scene,
  Vector3,
  WebGLRenderer,
} from "three";

import { compile, type MainModule } from "../physics/mujoco.js";
import type { Simulation } from "../physics/simulation.js";
import { GroundPicture, ShadowSpot } from "./ground.js";
import { Orbit } from "./orbit.js";
import { drawsInSoftware, PixelBudget } from "./pixel_budget.js";
import { buildRobot } from "./robot.js";
import { quadruple } from "../support/vectors.js";

const TRUNK = 1;

export class Picture {
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  readonly orbit = new Orbit();
  private readonly ground: GroundPicture;
  private readonly spot = new ShadowSpot();
  private readonly sun = new DirectionalLight(0xffffff, 2.2);
  private readonly robot;
  private readonly budget: PixelBudget;
  private readonly poses: [Pose, Pose];
  private readonly target = new Vector3(0, 0, 0.25);
  private size = { width: 1, height: 1 };

  /**
   * @param canvas Where to draw.
   * @param mujoco The module.
   * @param mjcf The scene with the robot's visual shapes.
   * @throws Error If the browser has no WebGL.
   */
  constructor(
    private readonly canvas: HTMLCanvasElement,
    mujoco: MainModule,
    mjcf: string,
  ) {
    const software = drawsInSoftware();
    this.budget = new PixelBudget(software);
    this.ground = new GroundPicture(software);
    this.renderer = new WebGLRenderer({
      canvas,
      antialias: !software,
      powerPreference: "high-performance",
    });
    this.renderer.shadowMap.type = PCFShadowMap;
    const model = compile(mujoco, mjcf, true);
    this.robot = buildRobot(mujoco, model, software ? 10 : 24);
    const bodies = model.nbody as number;
    model.delete();
    this.poses = [new Pose(bodies), new Pose(bodies)];
    this.furnish();
    this.orbit.listen(canvas);
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
  }

  /** Takes note of where the robot is after a control step. */
  keep(simulation: Simulation): void {
    this.poses.reverse();
    this.poses[1].read(simulation);
  }

  /** Takes note of a pause. */
  forget(): void {
    this.budget.forget();
  }

  /** The same where the robot begins anew: there is nothing between. */
  jump(simulation: Simulation): void {
    for (const pose of this.poses) pose.read(simulation);
    this.target.copy(this.poses[1].position(TRUNK));
  }

  /** Looks from where one sees what lies ahead: on stairs from behind, else from the front. */
  lookAhead(simulation: Simulation): void {
    this.orbit.lookAhead(simulation.flights !== null);
  }

  /** Draws with another floor's colour from now on. */
  paint(colour: readonly [number, number, number]): void {
    this.ground.paint(colour);
  }

  /**
   * Draws.
   *
   * @param between From the last control step but one, 0, to the last one, 1.
   * @param simulation Tells what ground there is.
   * @param seconds Time since the last picture.
   */
  draw(between: number, simulation: Simulation, seconds: number): void {
    if (this.budget.after(seconds)) this.resize();
    const [before, after] = this.poses;
    this.robot.children.forEach((body, index) => {
      body.position.lerpVectors(before.position(index), after.position(index), between);
      body.quaternion.slerpQuaternions(before.turn(index), after.turn(index), between);
    });
    const trunk = this.trunk.position;
    this.ground.follow(trunk.x, trunk.y, simulation.flights);
    this.target.lerp(trunk, Math.min(1, 6 * seconds));
    this.spot.position.set(trunk.x, trunk.y, simulation.groundHeight(trunk.x) + 0.004);
    this.sun.position.copy(trunk).add(new Vector3(1.2, -1.6, 4));
    this.sun.target.position.copy(trunk);
    this.orbit.lookAt(this.target);
    this.renderer.render(this.scene, this.orbit.camera);
  }

  private get trunk(): Object3D {
    return this.robot.children[TRUNK] as Object3D;
  }

  /** Triangles and calls of the last picture, for measurements. */
  get effort(): { triangles: number; calls: number; pixelRatio: number } {
    const { triangles, calls } = this.renderer.info.render;
    return { triangles, calls, pixelRatio: this.renderer.getPixelRatio() };
  }

  private furnish(): void {
    const sky = new Color(0xdfe7ee);
    this.scene.background = sky;
    this.scene.fog = new Fog(sky, 8, 28);
    const { shadow } = this.sun;
    shadow.mapSize.set(1024, 1024);
    Object.assign(shadow.camera, { left: -1, right: 1, top: 1, bottom: -1, near: 1, far: 8 });
    shadow.bias = -0.0005;
    const hemisphere = new HemisphereLight(0xffffff, 0x8a8378, 1.1);
    hemisphere.position.set(0, 0, 1);
    this.scene.add(this.ground, this.robot, this.spot, this.sun, this.sun.target, hemisphere);
    this.scene.add(new AmbientLight(0xffffff, 0.35));
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    this.size = { width, height };
    this.renderer.setPixelRatio(this.budget.ratio(window.devicePixelRatio));
    this.renderer.shadowMap.enabled = this.sun.castShadow = this.budget.shadows;
    this.spot.visible = !this.budget.shadows;
    this.renderer.setSize(this.size.width, this.size.height, false);
    const { camera } = this.orbit;
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
  }
}

/** Tells whether the browser has what pictures are made with. */
export function hasWebgl(): boolean {
  const context = document.createElement("canvas").getContext("webgl2");
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  return context !== null;
}

/** Where every body is. */
class Pose {
  private readonly positions: Vector3[];
  private readonly turns: Quaternion[];

  constructor(bodies: number) {
    this.positions = Array.from({ length: bodies }, () => new Vector3());
    this.turns = Array.from({ length: bodies }, () => new Quaternion());
  }

  position(body: number): Vector3 {
    return this.positions[body] as Vector3;
  }

  turn(body: number): Quaternion {
    return this.turns[body] as Quaternion;
  }

  read(simulation: Simulation): void {
    const { bodyPosition: at, bodyQuaternion: turned } = simulation;
    this.positions.forEach((position, body) => {
      position.fromArray(at, 3 * body);
    });
    this.turns.forEach((turn, body) => {
      const [w, x, y, z] = quadruple(turned, body);
      turn.set(x, y, z, w);
    });
  }
}
