/** The look of the ground: a floor without an end, and stairs on it, in the colour of the floor. */

import {
  BoxGeometry,
  CanvasTexture,
  CircleGeometry,
  Color,
  EdgesGeometry,
  Group,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshBasicMaterial,
  MeshLambertMaterial,
  PlaneGeometry,
  RepeatWrapping,
  SRGBColorSpace,
} from "three";

import type { Stairs } from "../physics/stairs.js";

/** Length of a tile, m. */
const TILE = 0.5;
const EXTENT = 80;

export class GroundPicture extends Group {
  private readonly floor: Mesh<PlaneGeometry, MeshLambertMaterial | MeshBasicMaterial>;
  private readonly boxes = new Group();
  private readonly stone = new MeshLambertMaterial();
  private readonly edges = new LineBasicMaterial({ transparent: true, opacity: 0.35 });
  private drawn = "";

  /** @param plain Whether to do without light, for machines to which that is too much. */
  constructor(plain: boolean) {
    super();
    const texture = new CanvasTexture(tiles());
    texture.wrapS = texture.wrapT = RepeatWrapping;
    texture.repeat.set(EXTENT / (2 * TILE), EXTENT / (2 * TILE));
    texture.colorSpace = SRGBColorSpace;
    texture.anisotropy = plain ? 1 : 8;
    this.floor = new Mesh(
      new PlaneGeometry(EXTENT, EXTENT),
      plain ? new MeshBasicMaterial({ map: texture }) : new MeshLambertMaterial({ map: texture }),
    );
    this.floor.receiveShadow = true;
    this.add(this.floor, this.boxes);
  }

  /** Takes on the colour of a floor, red, green and blue of 0 to 1. */
  paint(colour: readonly [number, number, number]): void {
    const [r, g, b] = colour;
    this.floor.material.color = new Color().setRGB(r, g, b, "srgb");
    this.stone.color = new Color().setRGB(r, g, b, "srgb");
    this.edges.color = new Color().setRGB(0.4 * r, 0.4 * g, 0.4 * b, "srgb");
  }

  /** Follows the robot, so that it never comes to an end. */
  follow(x: number, y: number, stairs: Stairs | null): void {
    const period = 2 * TILE;
    this.floor.position.set(period * Math.round(x / period), period * Math.round(y / period), 0);
    const wanted = stairs ? `${stairs.level} ${stairs.cell(x, y)}` : "";
    if (wanted === this.drawn) return;
    this.drawn = wanted;
    this.clearBoxes();
    for (const { centre, half } of stairs?.wide(x, y) ?? []) {
      const [length, width, height] = half.map((value) => 2 * value);
      const shape = new BoxGeometry(length, width, height);
      const box = new Mesh(shape, this.stone);
      box.position.set(...centre);
      box.receiveShadow = true;
      box.add(new LineSegments(new EdgesGeometry(shape), this.edges));
      this.boxes.add(box);
    }
  }

  private clearBoxes(): void {
    for (const box of this.boxes.children) {
      (box as Mesh).geometry.dispose();
      for (const line of box.children) (line as LineSegments).geometry.dispose();
    }
    this.boxes.clear();
  }
}

/** A dark spot below the robot, in place of a shadow, for machines to which shadows are too much. */
export class ShadowSpot extends Mesh {
  constructor() {
    super(
      new CircleGeometry(0.3, 24).scale(1, 0.75, 1),
      new MeshBasicMaterial({
        color: 0x000000,
        transparent: true,
        opacity: 0.16,
        depthWrite: false,
      }),
    );
  }
}

/** Two by two tiles of slightly different shades, to see the robot move by. */
function tiles(): HTMLCanvasElement {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 256;
  const context = canvas.getContext("2d");
  if (!context) return canvas;
  for (const [column, row, shade] of [
    [0, 0, 255],
    [1, 0, 236],
    [0, 1, 236],
    [1, 1, 255],
  ] as const) {
    context.fillStyle = `rgb(${shade} ${shade} ${shade})`;
    context.fillRect(128 * column, 128 * row, 128, 128);
    context.strokeStyle = "rgb(190 190 190)";
    context.strokeRect(128 * column, 128 * row, 128, 128);
  }
  return canvas;
}
