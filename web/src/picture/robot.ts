/** The robot's look: the visual shapes of its model as meshes, one for each body and material. */

import {
  BoxGeometry,
  type BufferGeometry,
  CapsuleGeometry,
  Color,
  CylinderGeometry,
  Group,
  Matrix4,
  Mesh,
  MeshPhongMaterial,
  Quaternion,
  SphereGeometry,
  Vector3,
} from "three";
import { mergeGeometries } from "three/examples/jsm/utils/BufferGeometryUtils.js";

import type { MainModule, MjModel } from "../physics/mujoco.js";
import { quadruple, triple } from "../support/vectors.js";

/** Group of the shapes that are there to be looked at. */
const VISUAL = 2;
const QUARTER_TURN = 0.5 * Math.PI;

/**
 * Makes a group whose children are the bodies, in the order of the model.
 *
 * @param detail Sides of what is round, from 8 on.
 */
export function buildRobot(mujoco: MainModule, model: MjModel, detail: number): Group {
  const robot = new Group();
  for (let body = 0; body < model.nbody; body++) robot.add(buildBody(mujoco, model, body, detail));
  return robot;
}

function buildBody(mujoco: MainModule, model: MjModel, body: number, detail: number): Group {
  const byMaterial = new Map<number, BufferGeometry[]>();
  for (let geom = 0; geom < model.ngeom; geom++) {
    if (model.geom_bodyid[geom] !== body || model.geom_group[geom] !== VISUAL) continue;
    const material = model.geom_matid[geom] as number;
    const shapes = byMaterial.get(material) ?? [];
    byMaterial.set(material, shapes);
    shapes.push(shapeOf(mujoco, model, geom, detail));
  }
  const group = new Group();
  for (const [material, shapes] of byMaterial) {
    const mesh = new Mesh(mergeGeometries(shapes), materialOf(model, material));
    mesh.castShadow = true;
    group.add(mesh);
    for (const shape of shapes) shape.dispose();
  }
  return group;
}

function shapeOf(mujoco: MainModule, model: MjModel, geom: number, detail: number): BufferGeometry {
  const [a, b, c] = triple(model.geom_size as Float64Array, geom);
  const kind = mujoco.mjtGeom;
  let shape: BufferGeometry;
  switch (model.geom_type[geom]) {
    case kind.mjGEOM_SPHERE.value:
      shape = new SphereGeometry(a, detail, detail >> 1);
      break;
    case kind.mjGEOM_CAPSULE.value:
      shape = new CapsuleGeometry(a, 2 * b, detail >> 2, detail).rotateX(QUARTER_TURN);
      break;
    case kind.mjGEOM_CYLINDER.value:
      shape = new CylinderGeometry(a, a, 2 * b, detail).rotateX(QUARTER_TURN);
      break;
    case kind.mjGEOM_BOX.value:
      shape = new BoxGeometry(2 * a, 2 * b, 2 * c);
      break;
    default:
      throw new Error(`shape ${geom} of the robot is of a kind that is not drawn`);
  }
  const [x, y, z] = triple(model.geom_pos as Float64Array, geom);
  const [qw, qx, qy, qz] = quadruple(model.geom_quat as Float64Array, geom);
  const place = new Matrix4().compose(
    new Vector3(x, y, z),
    new Quaternion(qx, qy, qz, qw),
    new Vector3(1, 1, 1),
  );
  return shape.applyMatrix4(place);
}

function materialOf(model: MjModel, material: number): MeshPhongMaterial {
  const [r, g, b] = quadruple(model.mat_rgba as Float32Array, material);
  const shine = model.mat_shininess[material] as number;
  return new MeshPhongMaterial({
    color: new Color().setRGB(r, g, b, "srgb"),
    specular: new Color(0x444444).multiplyScalar(model.mat_specular[material] as number),
    shininess: 90 * shine,
  });
}
