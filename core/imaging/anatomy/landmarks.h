// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/statusor.h"

#include "core/imaging/anatomy/bone_parts.h"
#include "core/imaging/anatomy/head_segmentation.h"
#include "core/imaging/anatomy/plane.h"

namespace tissueform {

struct LeftAndRight {
  Eigen::Vector3d left = Eigen::Vector3d::Zero();  // of the patient
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
};

// Points of a face in patient coordinates (LPS, mm), found from the labels: good for default planes
// and regions (a few mm), not for cephalometry. The midline is the midsagittal plane. Up is the
// normal of the lower teeth for the lower jaw and of the upper teeth for the rest, front is square
// to it.
struct Landmarks {
  Plane midsagittal;  // normal to the left

  // Bone and teeth: ends of what the labels hold (core/imaging/anatomy/remote_bone.h).
  Eigen::Vector3d menton = Eigen::Vector3d::Zero();         // lowest of the chin in the midline
  Eigen::Vector3d pogonion = Eigen::Vector3d::Zero();       // foremost of the chin in the midline
  Eigen::Vector3d lower_incisor = Eigen::Vector3d::Zero();  // highest of the lower front teeth
  Eigen::Vector3d upper_incisor = Eigen::Vector3d::Zero();  // lowest of the upper front teeth
  LeftAndRight lower_molar;       // highest of the lower jaw 25 to 36 mm behind the incisor
  LeftAndRight upper_molar;       // lowest of the upper jaw there
  LeftAndRight last_upper_tooth;  // rearmost of the upper crowns
  LeftAndRight ramus_front;       // front border of the ramus, 4 mm over the lower teeth
  LeftAndRight gonion;            // farthest back and down
  LeftAndRight condyle;           // top
  Eigen::Vector3d nasal_floor =
      Eigen::Vector3d::Zero();  // top of the hard palate, 15 to 30 mm behind the incisor

  // Planes through the incisor and midway between the molars, without cant: square to the
  // midsagittal plane; normal up. The occlusal plane lies midway between the two.
  Plane lower_teeth;
  Plane upper_teeth;
  Plane occlusal;

  // Skin, on the CT's isosurface.
  Eigen::Vector3d nose_tip = Eigen::Vector3d::Zero();
  Eigen::Vector3d subnasale = Eigen::Vector3d::Zero();  // rearmost between nose and upper lip
  Eigen::Vector3d upper_lip = Eigen::Vector3d::Zero();  // foremost of the lip in the midline
  Eigen::Vector3d lower_lip = Eigen::Vector3d::Zero();
  Eigen::Vector3d skin_pogonion = Eigen::Vector3d::Zero();  // foremost of the soft chin
  // How far the tip of the nose stands before the subnasale. (Not before the skin beside it: there
  // are the wings of a nose that is whole.)
  // Near 0 where the CT's field of view has cut the nose off, or something has pressed it flat.
  double nose_prominence_mm = 0;
  LeftAndRight mouth_corner;  // an estimate: the skin 25 mm beside the midline between the lips

  // Sets the three planes through the teeth from incisors, molars and the midsagittal plane.
  void SetTeethPlanes();

  // Forward in the midsagittal plane, square to the normal of a plane that looks up.
  Eigen::Vector3d ForwardOf(const Plane& plane) const;
};

// Errors: InvalidArgument that names the landmark that is not in view.
absl::StatusOr<Landmarks> FindLandmarks(const HeadSegmentation& head, const BoneParts& parts);

}  // namespace tissueform
