// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { VIEWS, type ViewName } from "../scene/views";
import type { Workbench } from "../workbench/workbench";

const SHOWN: readonly ViewName[] = ["front", "left", "threeQuarter"];
const SIZE = { width: 480, height: 560 };

/** The head from three sides as it is shown; none where the browser draws no pictures. Rejects with an Error where it has stopped drawing them. */
export async function reportPictures({ view }: Workbench): Promise<HTMLElement[]> {
  const figures: HTMLElement[] = [];
  for (const name of SHOWN) {
    const picture = await view.portrait(name, SIZE);
    if (picture !== null) figures.push(figure(picture, VIEWS[name].label));
  }
  await Promise.all(figures.map((element) => element.querySelector("img")?.decode()));
  return figures;
}

/** The picture on white. */
function figure(picture: HTMLCanvasElement, label: string): HTMLElement {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [picture.width, picture.height];
  const context = canvas.getContext("2d");
  if (context !== null) {
    context.fillStyle = "#ffffff";
    context.fillRect(0, 0, canvas.width, canvas.height);
    context.drawImage(picture, 0, 0);
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
