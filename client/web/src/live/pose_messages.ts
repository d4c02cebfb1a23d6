// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Pose } from "../geometry/pose";
import { type HandlePose, HandlePoseSchema, type Vector3 } from "../generated/tissueform/v1/geometry_pb";
import { create } from "@bufbuild/protobuf";
import type { Vector } from "../geometry/rotation";

/** As the protocol has it: one for each handle, in the order of `names`. */
export function toMessages(names: readonly string[], poses: readonly Pose[]): HandlePose[] {
  const vector = ([x, y, z]: Vector) => ({ x, y, z });
  return poses.map((pose, index) =>
    create(HandlePoseSchema, {
      handle: names[index],
      rotationVector: vector(pose.rotationVector),
      pivotMm: vector(pose.pivotMm),
      translationMm: vector(pose.translationMm),
      scale: pose.scale,
    }),
  );
}

/** By handle; parts that are left out are the identity. */
export function fromMessages(messages: readonly HandlePose[]): Map<string, Pose> {
  const vector = (v: Vector3 | undefined): Vector => [v?.x ?? 0, v?.y ?? 0, v?.z ?? 0];
  return new Map(
    messages.map((message) => [
      message.handle,
      {
        rotationVector: vector(message.rotationVector),
        pivotMm: vector(message.pivotMm),
        translationMm: vector(message.translationMm),
        scale: message.scale ?? 1,
      },
    ]),
  );
}
