// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import type { Page } from "playwright-core";
import { handMadeCase } from "../../client/web/tests/testing/hand_made_case";
import { ITS_MEASURES } from "../../client/web/tests/testing/hand_made_face";
import { type Hook, Planner, live, moved, openCase, saveExport, seriousFindings, state, takeSegment, typeMove } from "./planner";

let planner: Planner;
beforeAll(async () => (planner = await Planner.start()));
afterAll(() => planner.stop());

async function open(page: Page, title: string): Promise<void> {
  await page.locator("summary").getByText(title, { exact: true }).click();
}

/** Before and after of a measure, as the table has them; null where it has none. */
async function numbers(page: Page, name: string): Promise<[number, number] | null> {
  const cells = await page.locator(`[data-measure=${name}] td`).evaluateAll((all) => all.map((cell) => (cell.firstChild?.textContent ?? "").replace("−", "-")));
  return cells.length < 3 ? null : [Number(cells[0]), Number(cells[1])];
}

/** How far the number before lies from the value, rounded as it is shown; whether the one after is near it. */
function offBy(shown: [number, number] | null, value: number): [number, boolean] | null {
  return shown && [Math.abs(shown[0] - Number(value.toFixed(1))), Math.abs(shown[1] - value) < 0.15];
}

describe("the hand-made face", () => {
  let opened: Awaited<ReturnType<typeof openCase>>;
  beforeAll(async () => {
    const path = join(planner.folder, "hand-made.tfcase");
    writeFileSync(path, handMadeCase());
    opened = await openCase(await planner.browse(), planner, path);
  });
  afterEach(() => expect(opened.faults).toEqual([]));

  test("reports which landmarks are missing, and all its measures once suggestions are confirmed", async () => {
    const { page } = opened;
    await open(page, "Measures");
    await page.getByText("needs Nose tip, Upper lip, Soft pogonion").waitFor();
    await page.getByRole("button", { name: "Confirm all" }).click();
    await expect.poll(() => numbers(page, "e_line_upper_lip")).not.toBeNull();
    for (const [name, value] of Object.entries(ITS_MEASURES)) {
      await expect.poll(async () => offBy(await numbers(page, name), value), { message: name }).toEqual([0, true]);
    }
  });

  test("changes in its teeth by just what the jaw moves", async () => {
    const { page } = opened;
    await typeMove(page, "Forward", "2");
    await typeMove(page, "Left", "1");
    await expect.poll(() => numbers(page, "overjet")).toEqual([3, 1]);
    await expect.poll(() => numbers(page, "lower_midline")).toEqual([-1.5, -0.5]);
    expect(await numbers(page, "upper_midline")).toEqual([0.5, 0.5]);
  });

  test("takes a landmark from the hand, refuses what is no skin, and keeps landmarks over a reload", async () => {
    const { page } = opened;
    await open(page, "Landmarks");
    await page.getByRole("button", { name: "Remove Nose tip" }).click();
    await page.getByText("needs Nose tip").first().waitFor();
    await page.getByRole("button", { name: "Front", exact: true }).click();
    await page.getByRole("button", { name: "Place Nose tip" }).click();
    const canvas = page.locator(".picture .surface");
    await canvas.click({ position: { x: 20, y: 300 } });
    await page.getByText("Nose tip: there is no skin there; choose a point on it.").waitFor();
    // The middle of the picture lies upon the strip.
    await canvas.press("Enter");
    await page.locator(".picking").waitFor({ state: "hidden" });
    await expect.poll(() => numbers(page, "e_line_upper_lip")).not.toBeNull();
    await page.getByRole("button", { name: "Undo landmark" }).click();
    await page.getByRole("button", { name: "Undo landmark" }).click();
    await page.reload();
    await live(page);
    await open(page, "Measures");
    await expect.poll(async () => (await numbers(page, "facial_convexity"))?.[0]).toBe(Number(ITS_MEASURES.facial_convexity.toFixed(1)));
    expect(await numbers(page, "e_line_upper_lip")).not.toBeNull();
  });

  test("opens its jaw by one slider, and keeps the plan closed", async () => {
    const { page } = opened;
    await open(page, "Jaw and occlusion");
    const before = (await state(page)).moves;
    await page.getByLabel("Jaw rotation (hinge axis)").fill("20");
    await page.getByText(/Open by 20\.0°, 1\d\.\d mm between the incisors/).waitFor();
    expect((await state(page)).moves).toEqual(before);
    await page.getByRole("button", { name: "Show occlusal contacts" }).click();
    await page.getByText("The teeth are more than 6 mm apart.").waitFor();
    await page.locator(".legend").getByText("Distance between upper and lower teeth, mm").waitFor();
    expect(await page.locator(".legend .ticks span").allInnerTexts()).toEqual(["6.0", "3.0", "0.0"]);
    const canTake = () => page.evaluate(() => (globalThis as unknown as Hook).tissueform.bench.gizmo.controls.enabled as boolean);
    expect(await canTake()).toBe(false);
    await page.getByRole("button", { name: "Close", exact: true }).click();
    await page.getByText("Closed as planned").waitFor();
    await open(page, "Jaw and occlusion");
    await page.locator(".legend").waitFor({ state: "hidden" });
    expect(await canTake()).toBe(true);
  });

  test("is exported as plan, profile and report, which name nobody and load nothing", async () => {
    const { page } = opened;
    const save = async (button: string, file: string) => readFileSync(await saveExport(planner, page, button, file));
    const plan = JSON.parse((await save("Plan JSON", "tissueform-plan.json")).toString());
    expect(plan.measures.find(({ name }: { name: string }) => name === "overjet")).toMatchObject({ unit: "mm", before: 3, after: 1 });
    expect(plan.measurement_landmarks.placed.length).toBe(17);
    await open(page, "Profile");
    expect((await save("Profile SVG", "tissueform-profile.svg")).toString()).toMatch(/<svg[^]*Upper lip[^]*not a medical device/);
    expect((await save("Profile PNG", "tissueform-profile.png")).subarray(1, 4).toString()).toBe("PNG");
    await open(page, "Report");
    await page.getByRole("button", { name: "Open the report" }).click();
    await page.locator(".report").waitFor();
    await page.locator(".report").getByRole("cell", { name: "The case’s pivot (0.0, 40.0, 10.0)" }).waitFor();
    expect(await seriousFindings(page)).toEqual([]);
    const pdf = await page.pdf();
    expect(pdf.subarray(0, 5).toString()).toBe("%PDF-");
    expect(pdf.toString("latin1").match(/\/Type\s*\/Page\b/g)?.length).toBe(1);
    const html = (await save("Report HTML", "tissueform-report.html")).toString();
    expect(html).toContain("default-src 'none'");
    expect(html).toMatch(/not a medical device/i);
    expect(html).not.toMatch(/Hand-made face|<script|https?:\/\/(?!www\.w3\.org)/);
    await page.getByRole("button", { name: "Back to the plan" }).click();
    const { page: kept, faults } = await openReport(page, html);
    expect(await kept.locator(".report th").first().evaluate((cell) => getComputedStyle(cell).fontWeight)).toBe("600");
    expect(faults).toEqual([]);
  });
});

/** The file as a page of its own, with what its policy has refused. */
async function openReport(page: Page, html: string): Promise<{ page: Page; faults: string[] }> {
  const path = join(planner.folder, "opened-report.html");
  writeFileSync(path, html);
  const opened = await page.context().newPage();
  const faults: string[] = [];
  opened.on("console", (message) => faults.push(message.text()));
  await opened.goto(`file://${path}`);
  return { page: opened, faults };
}

function forwardOf(page: Page, place: string) {
  return page.getByRole("group", { name: `Target for ${place}` }).getByRole("textbox", { name: "forward" });
}

/** The arrow that points forward, which goes to the left as the head is seen from its left, by so many pixels. */
async function pullForward(page: Page, pixels: number): Promise<void> {
  const at = await page.evaluate(async () => {
    const { view, bench } = (globalThis as unknown as Hook).tissueform;
    await new Promise<void>((done) => view.stage.invalidate(done));
    const box = view.stage.surface.getBoundingClientRect();
    const point = view.head.toWorld(bench.targets.targets.value[0].place.drawnMm).project(view.stage.camera);
    return { x: box.left + ((point.x + 1) / 2) * box.width, y: box.top + ((1 - point.y) / 2) * box.height };
  });
  await page.mouse.move(at.x - 40, at.y);
  await page.mouse.down();
  await page.mouse.move(at.x - 40 - pixels, at.y, { steps: 6 });
  await page.mouse.up();
}

describe("the bundled head", () => {
  test("is pulled to a targeted chin, reports what cannot be reached, and takes the bone as one step", async () => {
    const { page, faults } = await openCase(await planner.browse(), planner);
    await open(page, "Soft-tissue targets");
    await page.getByLabel("or a place").selectOption({ label: "Chin" });
    const forward = forwardOf(page, "Chin");
    await forward.fill("5");
    await forward.press("Enter");
    await moved(page, 4, 9);
    await page.getByText(/Chin: reached, within 0\.\d\d mm/).waitFor();
    await forward.fill("60");
    await forward.press("Enter");
    await page.getByText(/Chin: cannot be reached; \d+\.\d mm are missing\./).waitFor();
    await page.getByText(/At its limit: /).waitFor();
    expect(await seriousFindings(page)).toEqual([]);
    await page.getByRole("button", { name: "Reject" }).click();
    await moved(page, 0, 0.05);
    await page.getByRole("button", { name: "Left", exact: true }).click();
    await page.getByLabel("or a place").selectOption({ label: "Lower lip" });
    await pullForward(page, 24);
    await moved(page, 2.5, 15);
    await forwardOf(page, "Lower lip").fill("3");
    await forwardOf(page, "Lower lip").press("Enter");
    await page.getByText(/Lower lip: reached/).waitFor();
    await page.getByRole("button", { name: "Accept" }).click();
    await moved(page, 2.5, 7);
    await page.keyboard.press("Control+z");
    await moved(page, 0, 0.05);
    // A target on a planned face leaves it: it begins where the skin is, and asks nothing.
    await takeSegment(page, "Lower jaw");
    await typeMove(page, "Forward", "6");
    await moved(page, 4, 8);
    const planned = (await state(page)).moves;
    await page.getByLabel("or a place").selectOption({ label: "Chin" });
    await expect.poll(() => forwardOf(page, "Chin").inputValue()).toMatch(/^[3-7]\.\d$/);
    await page.getByText("This is the planned face").waitFor();
    expect((await state(page)).moves).toEqual(planned);
    await page.getByRole("button", { name: "Remove the target for Chin" }).click();
    // This case has the scanner's axes alone.
    await open(page, "Measures");
    await page.getByText("In the scanner axes").waitFor();
    await open(page, "Profile");
    await expect.poll(() => page.locator(".profile path").last().getAttribute("d")).toMatch(/^M[\d.]+ [\d.]+L/);
    expect(faults).toEqual([]);
  });

  test("shows a band beside every number of the skin once the model knows one", async () => {
    const { page, faults } = await openCase(await planner.browse(), planner, planner.packWholeHead());
    await takeSegment(page, "Lower jaw");
    await typeMove(page, "Forward", "8");
    await moved(page, 6, 10);
    await open(page, "Measures");
    await page.getByRole("button", { name: "Confirm all" }).click();
    // Of surgery and model, which need no material; as wide as the command says of a lip: some millimeters.
    await page.locator(".measures caption").getByText("if surgery and model err as published").waitFor();
    const [lowest, highest] = (await page.locator("[data-measure=e_line_lower_lip] .band").innerText()).replaceAll("−", "-").split(" to ").map(Number);
    expect(highest - lowest).toBeGreaterThan(3);
    expect(highest - lowest).toBeLessThan(15);
    const parts = await page.locator("[data-measure=e_line_lower_lip] th small").last().innerText();
    const [, surgery, model] = /^of this surgery (\d+\.\d), model (\d+\.\d)$/.exec(parts) ?? [];
    expect(Math.hypot(Number(surgery), Number(model))).toBeCloseTo((highest - lowest) / 2, 0.6);
    const exported = JSON.parse(readFileSync(await saveExport(planner, page, "Plan JSON", "tissueform-plan.json"), "utf8"));
    const measure = exported.measures.find(({ name }: { name: string }) => name === "e_line_lower_lip");
    expect(measure.interval_of).toBe("surgery and model");
    expect([measure.lowest_after, measure.highest_after].map((value) => value.toFixed(1))).toEqual([lowest.toFixed(1), highest.toFixed(1)]);
    await page.getByText("Linear elastic", { exact: true }).click();
    await page.locator("[data-measure=e_line_lower_lip] .band").waitFor();
    await expect.poll(() => page.locator("[data-measure=e_line_lower_lip] .band").innerText()).toMatch(/^−?\d+\.\d to −?\d+\.\d$/);
    const row = page.getByRole("row", { name: "Soft pogonion" }).first();
    const band = (cell: number) => row.locator("td").nth(cell).locator(".band").innerText();
    await expect.poll(() => band(3)).toMatch(/^\d+\.\d to \d+\.\d$/);
    for (const component of [0, 1, 2]) expect(await band(component)).toMatch(/^± \d+\.\d$/);
    const widest = () => page.evaluate(() => {
      const { bench } = (globalThis as unknown as Hook).tissueform;
      const skin = bench.file.surfaces.findIndex(({ entry }: any) => entry.kind === "skin");
      return Math.max(0, ...(bench.bandOf(skin) ?? []));
    });
    await expect.poll(widest).toBeGreaterThan(0.05);
    await expect.poll(() => row.locator("th small").innerText()).toMatch(/^of this surgery \d+\.\d, model \d+\.\d, material \d+\.\d\d$/);
    await page.locator(".store button").click();
    await page.getByRole("button", { name: /^Compare / }).click();
    await page.getByText("The face that is shown is not the plan’s.").waitFor();
    const stored = page.locator("[data-measure=e_line_lower_lip] .band");
    await expect.poll(() => stored.innerText()).toMatch(/ to /);
    await page.getByLabel("Blend between the two").fill("0.5");
    await page.getByText("it has no 95 % interval").waitFor();
    await page.getByText("Back to the plan").click();
    await stored.waitFor();
    await open(page, "Report");
    await page.getByRole("button", { name: "Open the report" }).click();
    await page.locator(".report").getByRole("row", { name: "Lower lip to E-line" }).getByText(/\d to /).waitFor();
    await page.locator(".report").getByText("95 % interval: surgery, model and material together").waitFor();
    expect(await page.locator(".report img").evaluateAll((pictures) => pictures.map((picture) => (picture as HTMLImageElement).naturalWidth))).toEqual([480, 480, 480]);
    const pdf = (await page.pdf({ preferCSSPageSize: true })).toString("latin1");
    expect(pdf.match(/\/Type\s*\/Page\b/g)?.length).toBe(1);
    await page.emulateMedia({ colorScheme: "dark" });
    expect(await seriousFindings(page)).toEqual([]);
    expect(faults).toEqual([]);
  });
});

test("a clinic's deviations reach the intervals through its gateway, of an operation on request", async () => {
  const path = join(planner.folder, "deviations.json");
  const surgery = { translation_mm: [0, 0, 0], rotation_deg: [0, 0, 0] };
  writeFileSync(path, JSON.stringify({ source: "our clinic", surgery, model_mm: { default: 1 }, operations: { bsso: { surgery: { translation_mm: [0, 2, 0] } } } }));
  const clinic = await Planner.start(undefined, { gateway: ["--deviations", path] });
  try {
    const { page, faults } = await openCase(await clinic.browse(), clinic, clinic.packWholeHead());
    await page.getByText("Linear elastic", { exact: true }).click();
    await page.waitForFunction(() => (globalThis as unknown as Hook).tissueform.bench.localState.value.kind === "ready");
    await takeSegment(page, "Lower jaw");
    await typeMove(page, "Forward", "5");
    await page.getByText("if surgery and model err as our clinic,").waitFor();
    const incisor = page.locator(".movements tr", { hasText: "Lower incisor" });
    expect(await incisor.innerText()).toMatch(/of this surgery 0\.0/);
    await page.getByLabel("Intervals of").selectOption("bsso");
    await page.getByText("if surgery and model err as our clinic, bsso,").waitFor();
    // 1.96 of the 2 mm forward and back.
    await incisor.getByText("of this surgery 3.9").waitFor();
    expect(await incisor.innerText()).toMatch(/± 3\.9/);
    expect(await seriousFindings(page)).toEqual([]);
    expect(faults).toEqual([]);
  } finally {
    await clinic.stop();
  }
});
