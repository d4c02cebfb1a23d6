// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { isDeepStrictEqual } from "node:util";
import { Planner, type Hook, field, live, moved, openCase, openPage, state, takeSegment, typeMove } from "./planner";

let planner: Planner;
beforeAll(async () => (planner = await Planner.start()));
afterAll(() => planner.stop());

describe("a planner", () => {
  let opened: Awaited<ReturnType<typeof openCase>>;
  beforeAll(async () => (opened = await openCase(await planner.browse(), planner)));
  afterEach(() => expect(opened.faults).toEqual([]));

  test("shows the head at rest, and draws only on change", async () => {
    const first = await state(opened.page);
    expect(first.largestMm).toBeLessThan(0.02);
    expect(first.drawn).toBeGreaterThan(0);
    // The server's answer and the page's own may still come; then nothing is drawn.
    const drawnMeanwhile = async () => {
      const { drawn } = await state(opened.page);
      await opened.page.evaluate(() => new Promise((done) => setTimeout(done, 300)));
      return (await state(opened.page)).drawn - drawn;
    };
    await expect.poll(drawnMeanwhile).toBe(0);
  });

  test("moves bone and face by typed millimetres", async () => {
    const { page } = opened;
    await takeSegment(page, "Lower jaw");
    await typeMove(page, "Forward", "8 mm");
    await moved(page, 6, 10);
    const { moves, matrix } = await state(page);
    expect(moves[1].forwardMm).toBe(8);
    expect(Math.hypot(...matrix.slice(12, 15))).toBeCloseTo(8, 6);
  });

  test("takes back and brings back by keys", async () => {
    const { page } = opened;
    await page.keyboard.press("Control+z");
    await moved(page, 0, 0.05);
    // Numbers are written once a picture; the face may come before them.
    await expect.poll(() => field(page, "Forward").inputValue()).toBe("0.0");
    await page.keyboard.press("Control+y");
    await moved(page, 6, 10);
  });

  test("reports text that is not a number, and values beyond the limits", async () => {
    const { page } = opened;
    await typeMove(page, "Up", "a lot");
    await page.getByText("enter a number in millimeters").waitFor();
    await typeMove(page, "Up", "999");
    await page.getByText("up is limited to").waitFor();
    await typeMove(page, "Up", "0");
  });

  test("lets the hand pull the gizmo", async () => {
    const { page } = opened;
    await takeSegment(page, "Chin");
    await page.getByRole("button", { name: "Front", exact: true }).click();
    const grip = await page.evaluate(async () => {
      const { view, bench } = (globalThis as unknown as Hook).tissueform;
      await new Promise<void>((done) => view.stage.invalidate(done));
      const pose = bench.plan.poses()[2];
      const at = view.head.toWorld([0, 1, 2].map((k: number) => pose.pivotMm[k] + pose.translationMm[k]));
      const scale = view.stage.millimetresPerPixel;
      const box = view.stage.surface.getBoundingClientRect();
      at.project(view.stage.camera);
      return { x: box.left + ((at.x + 1) / 2) * box.width, y: box.top + ((1 - at.y) / 2) * box.height, scale };
    });
    // The arrow of the axis to the left: the screen's right, some pixels beside the middle.
    await page.mouse.move(grip.x + 40, grip.y);
    await page.mouse.down();
    await page.mouse.move(grip.x + 55, grip.y, { steps: 4 });
    await page.mouse.up();
    const { leftMm, upMm } = (await state(page)).moves[2];
    expect(leftMm).toBeGreaterThan(5 * grip.scale);
    expect(leftMm).toBeLessThan(25 * grip.scale);
    expect(upMm).toBeCloseTo(0, 6);
    await page.keyboard.press("Control+z");
    expect((await state(page)).moves[2].leftMm).toBe(0);
  });

  test("goes on with another model", async () => {
    const { page } = opened;
    await page.getByText("Linear elastic", { exact: true }).click();
    await page.waitForFunction(() => {
      const { bench } = (globalThis as unknown as Hook).tissueform;
      return bench.connection.value.kind === "live" && bench.live.model === 3 && bench.picture.value.summary.prepared;
    });
    await live(page);
    await moved(page, 6, 10);
  });

  test("lays a map with a legend upon the skin", async () => {
    const { page } = opened;
    await page.getByLabel("Color by").selectOption({ label: "Movement of the skin" });
    await page.locator(".legend").waitFor({ state: "visible" });
    const { legend } = await state(page);
    expect(legend?.largestMm).toBeGreaterThan(6);
    await page.locator(".legend").getByText(/^largest \d+\.\d\d mm, 95 % interval \(stiffness only\) \d+\.\d\d to \d+\.\d\d$/).waitFor();
    expect(legend?.mostMm).toBeGreaterThanOrEqual(legend?.largestMm ?? Infinity);
    await page.getByLabel("Color by").selectOption({ label: "Difference to Gradient field" });
    await page.waitForFunction(() => (globalThis as unknown as Hook).tissueform.bench.map.legend.value?.title === "Difference to Gradient field");
    expect((await state(page)).legend?.largestMm).toBeLessThan(8);
    await page.getByLabel("Color by").selectOption({ label: "95 % interval (material)" });
    await page.waitForFunction(() => (globalThis as unknown as Hook).tissueform.bench.map.legend.value?.title.startsWith("95 % interval"));
    await page.locator(".legend").getByText("stiffness only; excludes model and surgical error").waitFor();
    expect((await state(page)).legend?.largestMm).toBeGreaterThan(0.05);
    await page.getByLabel("Color by").selectOption({ label: "Skin color" });
    await page.locator(".legend").waitFor({ state: "hidden" });
  });

  test("stores a prediction by name and lays it beside the face at rest", async () => {
    const { page } = opened;
    await page.getByLabel("Name of the prediction").fill("Eight <b>forward</b>");
    await page.locator(".store button").click();
    await page.locator(".predictions li", { hasText: "Eight <b>forward</b>" }).waitFor();
    await page.getByRole("button", { name: "Compare Eight" }).click();
    await page.getByRole("group", { name: "Comparison" }).getByLabel("From", { exact: true }).selectOption({ label: "Pre-op face" });
    const share = page.getByLabel("Blend between the two");
    await share.fill("0");
    await moved(page, 0, 0.05);
    await share.fill("0.5");
    await moved(page, 3, 5);
    await share.fill("1");
    await moved(page, 6, 10);
    await page.getByText("Back to the plan").click();
    await moved(page, 6, 10);
  });

  test("sends a stored prediction on its way to the PACS, and takes it back", async () => {
    const { page } = opened;
    const stored = page.locator(".predictions li", { hasText: "Eight <b>forward</b>" });
    await stored.getByRole("button", { name: /^Send .* to the PACS$/ }).click();
    await stored.getByText("PACS: waiting for the bridge").waitFor();
    await stored.getByRole("button", { name: /^Withdraw / }).click();
    await stored.getByText("PACS: waiting for the bridge").waitFor({ state: "detached" });
    await moved(page, 6, 10);
  });

  test.each([["Face STL", "tissueform-face.stl"], ["Face PLY", "tissueform-face.ply"], ["Plan JSON", "tissueform-plan.json"], ["Picture", "tissueform.png"]])(
    "gives out %s that says that it is no medical device",
    async (name, file) => {
      const [download] = await Promise.all([opened.page.waitForEvent("download"), opened.page.getByRole("button", { name }).click()]);
      expect(download.suggestedFilename()).toBe(file);
      const path = join(planner.folder, file);
      await download.saveAs(path);
      const bytes = readFileSync(path);
      if (file.endsWith(".png")) expect(bytes.subarray(1, 4).toString()).toBe("PNG");
      else expect(bytes.toString("latin1")).toContain("not a medical device");
      if (file.endsWith(".json")) expect(JSON.parse(bytes.toString()).segments[1].move.forwardMm).toBe(8);
    },
  );

  test("comes back after a reload as it was", async () => {
    const { page } = opened;
    const before = await state(page);
    await page.waitForFunction(() => (globalThis as unknown as Hook).tissueform.bench.live.isKept);
    await page.reload();
    await live(page);
    await moved(page, 6, 10);
    const after = await state(page);
    expect(after.session).toBe(before.session);
    expect(after.moves[1].forwardMm).toBeCloseTo(8, 9);
    await page.locator(".predictions li", { hasText: "Eight <b>forward</b>" }).waitFor();
  });

  test("is drawn again after the browser took the graphics card away", async () => {
    const { page } = opened;
    await page.evaluate(() => {
      const context = (globalThis as unknown as Hook).tissueform.view.stage.renderer.getContext();
      const loss = context.getExtension("WEBGL_lose_context");
      loss.loseContext();
      setTimeout(() => loss.restoreContext(), 50);
    });
    await page.getByText("The picture is back.").waitFor();
    const drawn = (await state(page)).drawn;
    await typeMove(page, "Left", "1");
    await page.waitForFunction((count) => (globalThis as unknown as Hook).tissueform.view.stage.drawnCount > count, drawn);
    await page.keyboard.press("Control+z");
  });
});

describe("a whole head", () => {
  test("has fixed bone, teeth that go along, and landmarks that show how far", async () => {
    const { page, faults } = await openCase(await planner.browse(), planner, planner.packWholeHead());
    await takeSegment(page, "Lower jaw");
    await typeMove(page, "Forward", "8");
    await moved(page, 6, 10);
    const matrices = await page.evaluate(() => {
      const { surfaces } = (globalThis as unknown as Hook).tissueform.view.head;
      return surfaces.map((s: any) => [s.source.entry.kind, s.source.entry.handle, Math.hypot(...s.mesh.matrix.elements.slice(12, 15))]);
    });
    expect(matrices).toContainEqual(["bone", "", 0]);
    const teeth = matrices.find(([kind, handle]: string[]) => kind === "teeth" && handle === "mandible");
    expect(teeth[2]).toBeCloseTo(8, 6);
    // The first text of a cell is its number; an interval may be below.
    const row = (name: string) => page.getByRole("row", { name }).first().locator("td").evaluateAll((cells) => cells.map((cell) => cell.firstChild?.textContent));
    await expect.poll(() => row("Lower incisor")).toEqual(["8.0", "·", "·", "8.0"]);
    expect(await row("Upper incisor")).toEqual(["·", "·", "·", "·"]);
    await expect.poll(async () => Number((await row("Soft pogonion"))[0])).toBeGreaterThan(5);
    await typeMove(page, "Forward", "0");
    await typeMove(page, "Up", "-3");
    await page.getByText(/Lower jaw overlaps Chin by up to [1-5]\.\d mm\./).waitFor();
    // Its points are those of the closed jaw.
    const seesPoints = () => page.evaluate(() => (globalThis as unknown as Hook).tissueform.view.points.get("penetration").visible as boolean);
    expect(await seesPoints()).toBe(true);
    await page.locator("summary").getByText("Jaw and occlusion", { exact: true }).click();
    await page.getByLabel("Jaw rotation (hinge axis)").fill("5");
    expect(await seesPoints()).toBe(false);
    await page.locator("summary").getByText("Jaw and occlusion", { exact: true }).click();
    await expect.poll(seesPoints).toBe(true);
    await typeMove(page, "Up", "0");
    await page.locator(".warning").waitFor({ state: "hidden" });
    expect(faults).toEqual([]);
  });
});

describe("Follow link", () => {
  test("sees the same bytes as the planner, two of them, and the bone where it is", async () => {
    const context = await planner.browse();
    const { page, faults } = await openCase(context, planner);
    const { session } = await state(page);
    const link = page.url().replace("#case=", `#follow=${session.replace("sessions/", "")}&case=`);
    const { page: follower, faults: theirs } = await openPage(await planner.browse(), link);
    await page.getByText("one follows").waitFor();
    const { page: second } = await openPage(follower.context(), link);
    await page.getByText("2 follow").waitFor();
    await takeSegment(page, "Lower jaw");
    await typeMove(page, "Forward", "7");
    await moved(page, 5, 9);
    await moved(follower, 5, 9);
    await moved(second, 5, 9);
    const positions = (p: typeof page) => p.evaluate(() => Array.from((globalThis as unknown as Hook).tissueform.view.head.skins[0].shape.positions as Float32Array));
    // The page shows its own answer until the server's comes.
    await expect.poll(async () => isDeepStrictEqual(await positions(follower), await positions(page))).toBe(true);
    await expect.poll(async () => isDeepStrictEqual(await positions(second), await positions(page))).toBe(true);
    const matrix = await follower.evaluate(() => {
      const { view } = (globalThis as unknown as Hook).tissueform;
      return view.head.surfaces.find((s: any) => s.source.entry.handle === "mandible").mesh.matrix.elements as number[];
    });
    expect(Math.hypot(...matrix.slice(12, 15))).toBeCloseTo(7, 3);
    expect(await follower.locator("aside").count()).toBe(0);
    await second.close();
    await follower.close();
    await page.getByText("no followers").waitFor();
    expect([...faults, ...theirs]).toEqual([]);
  });
});

describe("bad input", () => {
  test("a case that is dropped opens, what is dropped beside it does not", async () => {
    const { page, faults } = await openPage(await planner.browse(), planner.url);
    const drop = (bytes: Buffer) =>
      page.locator(".drop").evaluate((zone, content) => {
        const dataTransfer = new DataTransfer();
        dataTransfer.items.add(new File([Uint8Array.from(atob(content), (char) => char.charCodeAt(0))], "head.tfcase"));
        zone.dispatchEvent(new DragEvent("drop", { dataTransfer, bubbles: true, cancelable: true }));
      }, bytes.toString("base64"));
    await drop(Buffer.from([1, 2, 3]));
    await page.getByRole("alert").getByText("This is not a case file").waitFor();
    await drop(readFileSync(planner.casePath));
    await live(page);
    expect(faults).toEqual([]);
  });

  test.each<[string, (bytes: Buffer) => Buffer, string]>([
    ["a file that is no case", () => Buffer.from("hello"), "This is not a case file"],
    ["a case that is cut off", (bytes) => bytes.subarray(0, bytes.length / 2), "copy it again"],
    ["a case that lies about its sizes", (bytes) => Buffer.from(bytes.toString("latin1").replace(/"vertex_count": ?\d+/, (text) => text.replace(/\d/g, "9")), "latin1"), "its counts say"],
  ])("%s is refused in words", async (_, change, text) => {
    const path = join(planner.folder, "broken.tfcase");
    writeFileSync(path, change(readFileSync(planner.casePath)));
    const { page, faults } = await openPage(await planner.browse(), planner.url);
    await page.setInputFiles("input[type=file]", path);
    await page.getByRole("alert").getByText(text).waitFor();
    expect(faults).toEqual([]);
  });

  test("a case that the server does not have is reported, with a way back", async () => {
    const { page } = await openPage(await planner.browse(), `${planner.url}/#case=${"0".repeat(64)}`);
    await page.getByText("The case cannot be opened").waitFor();
    await page.getByRole("button", { name: "Cases" }).click();
    await page.getByText("Drop a case file here").waitFor();
  });
});

describe("a server", () => {
  test("that is killed is a short pause", async () => {
    const { page, faults } = await openCase(await planner.browse(), planner);
    await takeSegment(page, "Lower jaw");
    await typeMove(page, "Forward", "5");
    await moved(page, 3, 7);
    await planner.killServer();
    await page.getByText("Reconnecting").waitFor();
    await typeMove(page, "Forward", "8");
    await planner.startServer();
    await live(page);
    await moved(page, 6, 10);
    expect(faults).toEqual([]);
  });

  test("that drains says so, and its successor goes on", async () => {
    const { page, faults } = await openCase(await planner.browse(), planner);
    planner.drainServer();
    await page.getByText("The server is shutting down").waitFor();
    await planner.drained();
    await planner.startServer();
    await live(page);
    await takeSegment(page, "Lower jaw");
    await typeMove(page, "Forward", "6");
    await moved(page, 4, 8);
    expect(faults).toEqual([]);
  });
});
