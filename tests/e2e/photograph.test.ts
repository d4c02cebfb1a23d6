// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { mkdirSync, readFileSync, statSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { pathToFileURL } from "node:url";
import type { Page } from "playwright-core";
import type { Vector } from "../../client/web/src/geometry/rotation";
import { MTL, bundledHead, frontOf, objOf, paintedImage, paintedUv } from "../../client/web/tests/testing/painted_photograph";
import { type Hook, Planner, moved, openCase, saveExport, seriousFindings, takeSegment, typeMove } from "./planner";

// The patient's own skin: a synthetic photograph of the bundled head, in cm and in the axes of a camera, from files to a moving file.
// With TISSUEFORM_PICTURES=FOLDER it writes the picture of docs/planner.md.

const PICTURES = process.env.TISSUEFORM_PICTURES ?? "";
const NAMES: Record<string, string> = { pronasale: "Nose tip", subnasale: "Subnasale", labrale_superius: "Upper lip", soft_pogonion: "Soft pogonion" };

let planner: Planner;
let opened: Awaited<ReturnType<typeof openCase>>;
let page: Page;
let files: string[];
const requests: string[] = [];
const { skin, landmarks } = bundledHead();
const nose = landmarks.get("pronasale") as Vector;
/** From LPS in mm to the camera's axes in cm: x left, y up, z forward. */
const toCamera = ([x, y, z]: Vector): Vector => [(x - nose[0]) / 10, (z - nose[2]) / 10, -(y - nose[1]) / 10];

beforeAll(async () => {
  planner = await Planner.start();
  const folder = join(planner.folder, "photograph");
  mkdirSync(folder);
  const front = frontOf(skin, nose);
  const uv = paintedUv(front, nose);
  for (let i = 0; i < front.positions.length; i += 3) front.positions.set(toCamera([front.positions[i], front.positions[i + 1], front.positions[i + 2]]), i);
  const contents: [string, string | Buffer][] = [["face.obj", objOf(front, uv)], ["face.mtl", MTL], ["face.png", paintedImage(landmarks)]];
  files = contents.map(([name, content]) => {
    writeFileSync(join(folder, name), content);
    return join(folder, name);
  });
  opened = await openCase(await planner.browse([], { viewport: { width: 1280, height: 800 } }), planner, planner.packWholeHead());
  page = opened.page;
  page.on("request", (request) => requests.push(`${request.method()} ${request.url()} ${request.postDataBuffer()?.length ?? 0}`));
});
afterAll(() => planner.stop());
afterEach(() => expect(opened.faults).toEqual([]));

const drawn = () => page.evaluate(() => (globalThis as unknown as Hook).tissueform.view.head.group.children.filter(({ name, visible }: any) => name === "photograph" && visible).length);

/** Positions of the photograph on the head. */
const positions = () =>
  page.evaluate(() => {
    const mesh = (globalThis as unknown as Hook).tissueform.view.head.group.children.find(({ name }: any) => name === "photograph");
    return Array.from(mesh.geometry.attributes.position.array as Float32Array);
  });

/** Clicks where a point of the stage is seen. */
async function clickAt(point: Vector): Promise<void> {
  const [x, y] = await page.evaluate((at) => {
    const { stage } = (globalThis as unknown as Hook).tissueform.view;
    const marking = stage.scene.children.find((child: any) => child.children.some(({ name }: any) => name === "photograph"));
    marking.updateMatrixWorld();
    const seen = marking.localToWorld(stage.camera.position.clone().set(...at)).project(stage.camera);
    const box = stage.surface.getBoundingClientRect();
    return [box.left + ((seen.x + 1) * box.width) / 2, box.top + ((1 - seen.y) * box.height) / 2];
  }, point.map((value) => 10 * value));
  await page.mouse.click(x, y);
}

test("a file that is no photograph is refused in a sentence", async () => {
  await page.locator("summary").getByText("Photograph", { exact: true }).click();
  await page.getByText("A face photograph identifies the patient").waitFor();
  await page.getByLabel(/^Files/).setInputFiles([files[2]]);
  await page.getByText(/^0 surfaces were given/).waitFor();
});

test("the photograph is read, marked and registered", async () => {
  await page.getByLabel(/^Files/).setInputFiles(files);
  await page.getByText(/^Unit by size: cm/).waitFor();
  for (const [name, label] of Object.entries(NAMES)) {
    await page.getByRole("button", { name: `Mark ${label} on the photograph` }).click();
    await clickAt(toCamera(landmarks.get(name) as Vector));
    await page.locator(".landmarks li[data-status=placed]", { hasText: label }).waitFor();
  }
  await page.getByRole("button", { name: "Register", exact: true }).click();
  const text = await page.getByText(/^Distance to the CT/).innerText();
  expect(Number(/([\d.]+) mm \(median\)/.exec(text)?.[1])).toBeLessThan(0.1);
  expect(await drawn()).toBe(1);
});

test("nothing of it was sent anywhere", () => {
  const isKnown = (request: string) => /^GET [^?]*\/assets\/[a-z_]+-[\w-]{8}\.(js|wasm) 0$/.test(request) || /ExportService\/ListExports \d{1,3}$/.test(request);
  expect(requests.filter((request) => !isKnown(request))).toEqual([]);
});

test("no serious findings of axe", async () => {
  expect(await seriousFindings(page)).toEqual([]);
});

test("it follows the jaw, and is where it was when the jaw is back", async () => {
  const before = await positions();
  await takeSegment(page, "Lower jaw");
  await typeMove(page, "Forward", "8");
  await moved(page, 6, 12);
  const largest = async () => (await positions()).reduce((most, value, i) => Math.max(most, Math.abs(value - before[i])), 0);
  await expect.poll(largest).toBeGreaterThan(5);
  expect(await largest()).toBeLessThan(12);
  if (PICTURES !== "") {
    await page.getByRole("button", { name: "3/4" }).click();
    await page.locator("details[aria-label=Photograph]").scrollIntoViewIfNeeded();
    await page.locator(".notice").waitFor({ state: "hidden" });
    await page.waitForTimeout(600);
    await page.screenshot({ path: join(PICTURES, "photograph.jpg"), type: "jpeg", quality: 88 });
  }
});

test("a color map hides it, and colors by distance do not", async () => {
  await page.getByLabel("Color by", { exact: true }).selectOption({ label: "Movement of the skin" });
  await expect.poll(drawn).toBe(0);
  await page.getByLabel("Color by", { exact: true }).selectOption({ label: "Skin color" });
  await expect.poll(drawn).toBe(1);
  await page.getByLabel(/^Color by distance to the CT/).check();
  expect(await drawn()).toBe(1);
  await page.getByLabel(/^Color by distance to the CT/).uncheck();
});

test("the moving file has it on request, and shows it moving", async () => {
  await page.waitForFunction(() => (globalThis as unknown as Hook).tissueform.bench.localState.value.kind === "ready");
  const without = statSync(await saveExport(planner, page, "Moving file", "tissueform-moves.html")).size;
  await page.getByLabel(/^Include the photograph/).check();
  const path = await saveExport(planner, page, "Moving file", "tissueform-moves.html");
  expect(readFileSync(path).length).toBeGreaterThan(without + 100_000);
  const context = await planner.browse();
  const file = await context.newPage();
  const faults: string[] = [];
  file.on("pageerror", (error) => faults.push(error.message));
  file.on("console", (message) => message.type() === "error" && faults.push(message.text()));
  await file.goto(pathToFileURL(path).href);
  await file.getByLabel("Photograph").waitFor();
  await file.waitForFunction(() => ((globalThis as any).tissueform.moving?.photograph?.followed ?? 0) > 1);
  const hasTexture = await file.evaluate(() => (globalThis as any).tissueform.moving.photograph.mesh.material.map !== null);
  expect([hasTexture, faults]).toEqual([true, []]);
  if (PICTURES !== "") {
    await file.waitForTimeout(600);
    await file.screenshot({ path: join(PICTURES, "photograph-file.jpg"), type: "jpeg", quality: 88 });
  }
});
