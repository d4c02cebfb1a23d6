// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { messageOf } from "../calls/call_error";
import type { Gateway } from "../calls/gateway";
import type { CaseFile } from "../case/case_file";
import { contactChoiceOf, contactSuffix, sealedPairs } from "../case/contact_choice";
import type { SurfaceKind } from "../case/manifest";
import { type Evaluation, LARGEST_BAND_ROTATION } from "../evaluation/answer_evaluator";
import type { SolveSummary } from "../generated/tissueform/v1/deform_service_pb";
import type { Prediction } from "../generated/tissueform/v1/prediction_pb";
import type { ModelInfo } from "../generated/tissueform/v1/server_info_pb";
import type { DeformationModel } from "../generated/tissueform/v1/session_pb";
import { BoneSolid, type Penetration, PenetrationTest } from "../geometry/penetration";
import type { Vector } from "../geometry/rotation";
import { type Pose, fromLps, toMove } from "../geometry/pose";
import type { DisplayedFrame } from "../live/drag_session";
import { type Connection, LiveSession } from "../live/live_session";
import { LocalAnswers, type LocalState } from "../live/local_answers";
import { type ShownFace, suggestLandmarks } from "../measures/face_measures";
import { LandmarkBook } from "../measures/landmark_book";
import type { Anchor } from "../measures/anchor";
import type { PlanAnswers } from "../measures/whole_band";
import type { BoundPhotograph } from "../movingdata/photograph_data";
import { JawOpening } from "../planning/jaw_opening";
import { Plan } from "../planning/plan";
import { Gizmo } from "../scene/gizmo";
import type { HeadView } from "../scene/head_view";
import type { Volume } from "../volume/volume";
import { Answers } from "./answers";
import { Comparer, type Comparison, type Shape } from "./comparison";
import { type ShownLegend, followedRest, subtractInto } from "./face_colors";
import { FaceMap, type MapChoice } from "./face_map";
import { NewestAnswer } from "./newest_answer";
import { PacsExports } from "./pacs_exports";
import type { ShownAnswer } from "./shown_answer";
import { Signal } from "./signal";
import { storedMeasures } from "./stored_measures";
import { StoredPredictions } from "./stored_predictions";
import { type Target, TargetFit } from "./target_fit";
import { type TargetPlace, shownMove } from "./target_place";
import { type Touch, TouchReader } from "./touch";
import { recallLandmarks, rememberLandmarks } from "./work";

/** What the server's last picture was answered with, be it shown or not. */
export interface PictureFacts {
  roundTripMs: number;
  summary: SolveSummary | null;
}

/** A point of a surface that the user is asked to click. */
export interface Picking {
  prompt: string;
  kinds: readonly SurfaceKind[];
  /** Null: nothing of these kinds was there. */
  take(anchor: Anchor | null): void;
  /** In place of `take`, where the point is not on the case: a place of the picture, in the page's pixels. */
  takeAt?(x: number, y: number): void;
}

const SETTLE_MS = 150;
/** The bridge makes its models from the case, which has the mesh whose lips part. */
const SEALED_NOT_TO_PACS = "this prediction has sealed lips, and cannot be sent: choose that lips part under Contact, store the prediction there, and send that";
const NOT_TO_PACS = "this prediction has tissue that sticks, and cannot be sent: choose that lips part under Contact, store the prediction there, and send that";

/**
 * A case on the table: the plan, the session that answers it, the head that shows the answer, and what is laid beside it. The
 * panels show its signals and call it; it knows nothing of them.
 */
export class Workbench implements ShownFace {
  readonly plan: Plan;
  readonly gizmo: Gizmo;
  readonly answers: Answers;
  readonly live: LiveSession;
  readonly landmarks: LandmarkBook;
  readonly jaw: JawOpening;
  readonly targets: TargetFit;
  readonly pacs: PacsExports;
  readonly stored: StoredPredictions;
  readonly local: LocalAnswers;
  readonly map: FaceMap;
  private readonly touchReader: TouchReader;

  readonly selected = new Signal(0);
  readonly connection = new Signal<Connection>({ kind: "preparing", text: "Opening", share: null });
  readonly followers = new Signal(0);
  readonly notice = new Signal("");
  readonly picture = new Signal<PictureFacts | null>(null);
  /** Whose answer the plan's face is, which a comparison hides. */
  readonly answer = new Signal<ShownAnswer | null>(null);
  readonly localState = new Signal<LocalState>({ kind: "none" });
  readonly model = new Signal<DeformationModel>(0);
  /** A CT of this patient in the coordinates of the case, which the slices show. It stays in the page. */
  readonly volume = new Signal<Volume | null>(null);
  readonly comparison = new Signal<Comparison | null>(null);
  readonly penetrations = new Signal<Penetration[]>([]);
  /** Teeth alone are shown, colored by this legend; null: the whole head. */
  readonly bite = new Signal<ShownLegend | null>(null);
  /** What the next click upon the picture is for; null: for nothing but looking and taking a segment. */
  readonly picking = new Signal<Picking | null>(null);
  /** The registered photograph; null: none. */
  readonly photograph = new Signal<BoundPhotograph | null>(null);
  /** The face or the bone on the stage changed. */
  readonly shown = new Signal(0);

  /** Of CaseFile.followed. */
  private readonly rest: Float32Array;
  private readonly comparer: Comparer;
  private readonly newest: NewestAnswer;
  private readonly penetrationTest: PenetrationTest;
  /** Of the face that is shown: of each of CaseFile.followed, mm; null where none is known. */
  private shownBand: Float32Array | null = null;
  /** Why it has none, where tissue touches. */
  private noBand = "";
  private seeking: AbortController | undefined;
  private waitingFrom: number | null = null;
  private settling: ReturnType<typeof setTimeout> | undefined;

  /** `models`: of the server. */
  constructor(
    private readonly gateway: Gateway,
    readonly file: CaseFile,
    readonly caseName: string,
    readonly view: HeadView,
    readonly models: readonly ModelInfo[],
  ) {
    this.plan = new Plan(file);
    this.landmarks = new LandmarkBook(file);
    this.jaw = new JawOpening(file);
    const rest = (this.rest = followedRest(file));
    this.newest = new NewestAnswer(rest);
    this.touchReader = new TouchReader(file, rest);
    this.answers = new Answers(gateway, file, caseName, rest);
    this.pacs = new PacsExports(gateway, caseName);
    this.stored = new StoredPredictions(this.answers, this.pacs, {
      question: () => ({ session: this.live.session, model: this.model.value, poses: this.plan.poses() }),
      measuresOf: async (prediction) => {
        if (isSealed(prediction)) throw new Error(SEALED_NOT_TO_PACS);
        if (prediction.mesh !== (file.parted ?? file).manifest.mesh.name) throw new Error(NOT_TO_PACS);
        return storedMeasures({ file, landmarks: this.landmarks, comparer: this.comparer, planned: this.planned, answers: this.planAnswers }, prediction);
      },
      onRemoved: async ({ name }) => {
        if (this.comparison.value?.to.name === name) await this.compare(null);
      },
    });
    this.comparer = new Comparer(this.plan, this.answers, (prediction, poses) => (this.knowsBand(prediction.model) ? this.local.bandAt(poses) : Promise.resolve(null)));
    this.map = new FaceMap(view.head, {
      ofModel: (model) => this.answers.ofModel(this.live.session, model, this.plan.poses()),
      ofPrediction: (prediction) => this.answers.ofPrediction(prediction),
    });
    this.targets = new TargetFit(
      file,
      this.plan,
      (request) => this.answers.fit({ ...request, session: this.live.session, model: this.model.value }),
      () => (this.notice.value = "The plan changed; soft-tissue targets were cleared."),
    );
    const solids = file.surfaces.filter(({ entry }) => entry.kind === "bone" || entry.kind === "segment");
    const label = (handle: string) => file.manifest.handles.find(({ name }) => name === handle)?.label;
    this.penetrationTest = new PenetrationTest(
      solids.map(({ entry, positions, triangles }) => new BoneSolid(label(entry.handle) ?? "the fixed bone", entry.handle, positions, triangles)),
    );
    this.gizmo = new Gizmo(view.stage, view.head, (pose, isFinal) => this.pull(pose, isFinal));
    this.model.value = models.find((model) => model.name === file.manifest.model)?.model ?? file.sessionRequest.model;
    this.local = new LocalAnswers(gateway, {
      onState: (state) => (this.localState.value = state),
      onEvaluation: (evaluation) => this.showLocal(evaluation),
    });
    // A session with another contact has a place of its own in what the browser remembers.
    this.live = new LiveSession(gateway, file, rememberedAs(caseName, file), {
      onConnection: (connection) => (this.connection.value = connection),
      onPicture: (picture, used) => this.show(picture, used),
      onCommittedPoses: (poses) => this.plan.setPoses(poses),
      onFollowers: (count) => (this.followers.value = count),
      onNotice: (text) => (this.notice.value = text),
      onStarted: (configuration) => void this.local.follow(configuration),
      onUpdated: () => this.local.renew(),
    }, this.dragChoice());
    this.plan.onChange((_, { isFinal }) => this.planChanged(isFinal));
    this.selected.watch(() => this.placeGizmo());
  }

  async start(): Promise<void> {
    this.landmarks.suggest(suggestLandmarks(this.file, this.landmarks));
    this.landmarks.restore(recallLandmarks(this.caseName));
    this.landmarks.onChange(() => rememberLandmarks(this.caseName, this.landmarks.save()));
    this.setPoses(this.plan.poses());
    this.pacs.start();
    const noList = (thrown: unknown) => (this.notice.value = `The stored predictions cannot be listed: ${messageOf(thrown)}`);
    await Promise.all([this.live.start(this.plan.poses()), this.stored.load().catch(noList)]);
  }

  /** For how long a pose has been waiting for its picture, in ms; 0: none is. */
  get waitingMs(): number {
    return this.waitingFrom === null ? 0 : performance.now() - this.waitingFrom;
  }

  modelInfo(model: DeformationModel): ModelInfo | undefined {
    return this.models.find((info) => info.model === model);
  }

  async chooseModel(model: DeformationModel): Promise<void> {
    this.model.value = model;
    this.answer.value = null;
    this.local.drop();
    if (this.map.choice.value.kind === "band" && !this.hasBand) this.map.choice.value = { kind: "none" };
    await this.live.choose(this.dragChoice());
  }

  /** Rejects where what is compared with could not be had; the map is off then. */
  async chooseMap(choice: MapChoice): Promise<void> {
    try {
      await this.map.choose(choice);
    } finally {
      this.redraw();
    }
  }

  /** The band needs ranges of the material and an elastic model. Where tissue touches it comes when the hand rests. */
  get hasBand(): boolean {
    return this.isUncertain(this.model.value);
  }

  /** Prepared answers know it. */
  get hasBandAtOnce(): boolean {
    return this.knowsBand(this.model.value);
  }

  /** Of what is shown, in words; empty where there is one, or none yet. */
  get whyNoBand(): string {
    if (!this.hasBand) return "this model or case has none";
    if (this.touches) return this.shownBand === null ? this.noBand : "";
    const turnsTooFar = Array.from(this.shownPoses.values()).some(({ rotationVector }) => Math.hypot(...rotationVector) > LARGEST_BAND_ROTATION);
    return this.shownBand === null && turnsTooFar ? "a segment turns by more than 30 degrees, which linear elasticity treats as strain" : "";
  }

  async compare(comparison: Comparison | null): Promise<void> {
    if (comparison !== null) {
      await this.answers.ofPrediction(comparison.to);
      if (typeof comparison.from === "object") await this.answers.ofPrediction(comparison.from);
    }
    this.comparison.value = comparison;
    this.gizmo.hide("comparison", comparison !== null);
    this.showPenetrations();
    await this.redraw();
  }

  /** How far the skin at a place is from rest by the plan's newest answer, in the head frame. */
  readonly moveAt = (place: TargetPlace): Target["move"] => fromLps(shownMove(place, this.newest.displacements), this.file.manifest.headFrame);

  positionsOf(surface: number): Float32Array {
    return this.view.head.surfaces[surface].shape.positions;
  }

  /** Of a surface's vertices, in mm; null where it is not known for what is shown. */
  bandOf(surface: number): Float32Array | null {
    if (this.shownBand === null) return null;
    const { shape } = this.view.head.surfaces[surface];
    const band = new Float32Array(shape.positions.length / 3);
    shape.spread(this.shownBand, band);
    return band;
  }

  get showsPlan(): boolean {
    return this.comparison.value === null && this.jaw.degrees === 0;
  }

  open(degrees: number): void {
    this.jaw.degrees = degrees;
    this.showPenetrations();
    this.planChanged(degrees === 0);
  }

  /** Teeth alone, with this legend of their colors; null: all. */
  showBite(legend: ShownLegend | null): void {
    this.bite.value = legend;
    this.view.head.setTeethOnly(legend !== null);
    this.gizmo.hide("bite", legend !== null);
    this.showPenetrations();
    this.view.stage.invalidate();
  }

  /** How tissue touches in the plan's newest answer; null where this page does not know. `areasMm2`: see contactAreas, for pressures. */
  async touch(areasMm2: Float64Array | null = null): Promise<Touch | null> {
    if (this.touchReader.isEmpty) return null;
    const forcesN = await this.local.contactAt(this.jaw.apply(this.plan.poses()));
    return forcesN === null ? null : this.touchReader.read(this.newest.displacements, forcesN, areasMm2);
  }

  /** Whether `planAnswers` knows what is shown before it is drawn: the page evaluates by itself, and shows the plan. */
  get answersAtOnce(): boolean {
    return this.local.answersAtOnce && this.showsPlan;
  }

  get planAnswers(): PlanAnswers {
    return { handles: this.plan.handles, poses: () => this.plan.poses(), skinPointsAt: (poseSets, anchors) => this.skinPointsAt(poseSets, anchors) };
  }

  /** Where points of the skin would be under other poses, by the page's own answers; null where it has none of them. */
  async skinPointsAt(poseSets: readonly (readonly Pose[])[], anchors: readonly Anchor[]): Promise<Vector[][] | null> {
    const { skinPointsAt } = await import("../measures/skin_points");
    return skinPointsAt(this.file, this.rest, (sets, vertices) => this.local.placesAt(sets, vertices), poseSets, anchors);
  }

  /** Skin and bone under other poses, by the page's own answers; null where it has none of them. */
  async shapeAt(poses: Pose[]): Promise<Shape | null> {
    const displacements = await this.displacementsAt(poses);
    return displacements && { displacements, uncertainty: this.hasBandAtOnce ? await this.local.bandAt(poses) : null, poses };
  }

  /** Where bone overlaps under other poses, more than pre-op. */
  penetrationsAt(poses: readonly Pose[]): Penetration[] {
    return this.penetrationTest.find(this.posesByHandle(poses));
  }

  posesByHandle(poses: readonly Pose[]): Map<string, Pose> {
    return new Map(this.plan.handles.map((handle, index) => [handle.name, poses[index]]));
  }

  /** Poses of the bone as it is shown. */
  shownPoses: ReadonlyMap<string, Pose> = new Map();

  /** Of sealed lips; null where they are free or this page does not know. */
  sealState(): Promise<{ partedMm: number; released: boolean } | null> {
    return sealedPairs(this.file) === 0 ? Promise.resolve(null) : this.local.sealAt(this.jaw.apply(this.plan.poses()));
  }

  /** Tissue slides and lips part: the case has contact rows, and they count. */
  get touches(): boolean {
    return this.file.sessionRequest.contact.length > 0;
  }

  /** Of CaseFile.followed. */
  private async displacementsAt(poses: readonly Pose[]): Promise<Float32Array | null> {
    const positions = await this.local.positionsAt(poses);
    if (positions === null || positions.length !== this.rest.length) return null;
    return subtractInto(positions, this.rest, positions);
  }

  private knowsBand(model: DeformationModel): boolean {
    return !this.touches && this.isUncertain(model);
  }

  private isUncertain(model: DeformationModel): boolean {
    const info = this.modelInfo(model);
    return this.file.materialRanges !== null && info !== undefined && info.hasPreparedAnswers && info.name !== "gradient_field";
  }

  private dragChoice() {
    const info = this.modelInfo(this.model.value);
    const isPrepared = (this.touches ? info?.hasPreparedContact : info?.hasPreparedAnswers) ?? false;
    return { model: this.model.value, isPrepared, ranges: this.hasBandAtOnce ? this.file.materialRanges : null };
  }

  private pull(pose: Pose, isFinal: boolean): void {
    const index = this.selected.value;
    this.plan.change(index, toMove(pose, this.plan.pivot(index), this.file.manifest.headFrame), isFinal);
  }

  private planChanged(isFinal: boolean): void {
    const poses = this.jaw.apply(this.plan.poses());
    // What the server keeps is the plan.
    this.live.sendPoses(poses, isFinal && this.jaw.degrees === 0);
    this.waitingFrom ??= performance.now();
    if (this.comparison.value === null) this.setPoses(poses);
    this.local.ask(poses);
    if (!this.gizmo.isDragging) this.placeGizmo();
    clearTimeout(this.settling);
    this.settling = setTimeout(() => this.settled(), SETTLE_MS);
  }

  /** The hand rests: what takes longer than a picture is done now. */
  private settled(): void {
    this.penetrations.value = this.penetrationsAt(this.plan.poses());
    this.showPenetrations();
    if (this.map.choice.value.kind === "model") {
      this.map.refresh().then(
        () => this.redraw(),
        (thrown) => (this.notice.value = messageOf(thrown)),
      );
    }
  }

  /** The points are those of the plan's bone: not beside other bone, nor where none is drawn. */
  private showPenetrations(): void {
    const isShown = this.showsPlan && this.bite.value === null;
    this.view.setPoints("penetration", isShown ? this.penetrations.value.flatMap((penetration) => penetration.points) : []);
  }

  private placeGizmo(): void {
    this.gizmo.place(this.plan.poses()[this.selected.value]);
    this.view.select(this.plan.handles[this.selected.value]?.name ?? "");
  }

  private show(picture: DisplayedFrame, used: () => void): void {
    const isTaken = this.newest.takePicture(picture, this.local.posesSinceShown);
    this.waitingFrom = null;
    this.picture.value = { roundTripMs: picture.roundTripMs, summary: picture.frame.summary ?? null };
    this.answer.value = this.newest.answer;
    if (isTaken && this.comparison.value === null) this.lay(this.newest, used);
    else used();
  }

  /** The page's own answer, in the picture that shows the bone there. */
  private showLocal(evaluation: Evaluation): void {
    if (!this.newest.takeOwn(evaluation)) return this.local.drop();
    this.answer.value = this.newest.answer;
    if (this.comparison.value === null) this.lay(this.newest);
  }

  private lay({ displacements, uncertainty }: Pick<NewestAnswer, "displacements" | "uncertainty">, used?: () => void): void {
    this.shownBand = uncertainty;
    this.seekBand();
    this.view.head.setDisplacements(displacements);
    this.map.show(displacements, uncertainty);
    this.view.stage.invalidate(used);
    this.shown.value += 1;
  }

  /** Of the plan's newest answer, once the hand rests. */
  private seekBand(): void {
    this.seeking?.abort();
    if (!this.touches || !this.hasBand || this.shownBand !== null || this.comparison.value !== null) return;
    this.noBand = "it comes when the hand rests";
    const { signal } = (this.seeking = new AbortController());
    const ask = () => ({ file: this.file, session: this.live.session, model: this.model.value, poses: this.jaw.apply(this.plan.poses()) });
    void import("./resting_band")
      .then(({ findBand }) => findBand(this.gateway, ask, signal))
      .then(
        ({ bandMm, reason }) => {
          if (signal.aborted) return;
          this.noBand = reason;
          if (bandMm !== null) this.newest.takeBand(bandMm);
          if (bandMm !== null) this.lay(this.newest);
          else this.shown.value += 1;
        },
        (thrown) => signal.aborted || (this.noBand = messageOf(thrown)),
      );
  }

  private setPoses(poses: readonly Pose[]): void {
    this.shownPoses = this.posesByHandle(poses);
    this.view.setPoses(this.shownPoses);
    this.shown.value += 1;
  }

  /** The plan's face, the jaw open or not. */
  private get planned(): Shape {
    const { displacements, uncertainty } = this.newest;
    return { displacements, uncertainty, poses: this.jaw.apply(this.plan.poses()) };
  }

  private async redraw(): Promise<void> {
    const comparison = this.comparison.value;
    const shape = comparison === null ? this.planned : await this.comparer.between(comparison, this.planned);
    // The user may have chosen another comparison since then.
    if (comparison !== this.comparison.value) return;
    this.lay(shape);
    this.setPoses(shape.poses);
  }
}

function rememberedAs(caseName: string, file: CaseFile): string {
  const choice = contactChoiceOf(file);
  return choice === "on" ? caseName : `${caseName}#${contactSuffix(choice)}`;
}

function isSealed({ summary }: Prediction): boolean {
  return summary?.seal !== undefined && !summary.seal.released;
}
