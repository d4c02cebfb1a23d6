// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { VIEWS, type ViewName } from "../scene/views";
import type { Workbench } from "../workbench/workbench";

const SHOWN: readonly ViewName[] = ["front", "left", "threeQuarter"];
const WIDTH_PX = 480;
const HEIGHT_PX = 560;

/** The head from three sides as it is shown; none where the browser draws no pictures. */
export async function reportPictures({ view }: Workbench): Promise<HTMLElement[]> {
  const figures: HTMLElement[] = [];
  for (const name of SHOWN) {
    const picture = view.portrait(name);
    if (picture !== null) figures.push(figure(picture, VIEWS[name].label));
  }
  await Promise.all(figures.map((element) => element.querySelector("img")?.decode()));
  return figures;
}

/** The middle of the picture, on white. */
function figure(picture: HTMLCanvasElement, label: string): HTMLElement {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [WIDTH_PX, HEIGHT_PX];
  const context = canvas.getContext("2d");
  if (context !== null) {
    context.fillStyle = "#ffffff";
    context.fillRect(0, 0, WIDTH_PX, HEIGHT_PX);
    const height = picture.height;
    const width = Math.min(picture.width, (height * WIDTH_PX) / HEIGHT_PX);
    context.drawImage(picture, (picture.width - width) / 2, 0, width, height, 0, 0, (width * HEIGHT_PX) / height, HEIGHT_PX);
  }
  const image = document.createElement("img");
  image.src = canvas.toDataURL("image/jpeg", 0.85);
  image.alt = `The head, ${label}`;
  const caption = document.createElement("figcaption");
  caption.textContent = label;
  const element = document.createElement("figure");
  element.append(image, caption);
  return element;
}
