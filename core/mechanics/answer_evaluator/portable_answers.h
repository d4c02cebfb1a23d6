// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

// This folder includes the standard library only, so that programs can evaluate prepared answers as
// bytes without the code that made them. docs/prepared-answers.md describes the same in words.
namespace tissueform {

enum class AnswerModel { kGradientField = 1, kLinearElastic = 2, kNeoHookean = 3 };

// All that is one number. Doubles, so that they are one section; lengths and angles in mm and rad.
struct AnswerNumbers {
  double model = 0;  // an AnswerModel
  double num_vertices = 0;
  double num_handles = 0;

  // What is covered.
  double tolerance_mm = 0;
  double max_rotation_rad = 0;  // of linear_elastic no limit: that of poses that digits suffice for
  double max_scale_change = 0;  // |s - 1|; of gradient_field
  double max_estimate_mm = 0;   // of neo_hookean

  double largest_rest_mm = 0;  // distance of a free vertex from zero; not of neo_hookean

  // Of gradient_field.
  double num_polynomials = 0;  // that are answered with
  double degree = 0;           // of all that are expanded
  double simplex_width = 0;
  double largest_gain_mm = 0;

  // Of neo_hookean.
  double size_mm = 0;
  double estimate_scale = 0;
  double cut_per_mm = 0;
  double rounding_mm = 0;
};

// A matrix of fixed-point numbers, column-major: an entry is (65536 upper + lower) step, and upper
// alone stands for 65536 upper step. Of the last columns there are lower halves.
struct PackedColumns {
  std::vector<double> steps;  // a column each
  std::vector<int16_t> upper;
  std::vector<int16_t> lower;
};

// Prepared answers of one model with everything that their evaluation needs.
struct PortableAnswers {
  static constexpr int32_t kFixed = -1;
  static constexpr int32_t kFree = -2;

  AnswerNumbers numbers;

  // Of every vertex of an answer: kFree, kFixed or its handle. Rest positions of each kind in the
  // order of the answer, x y z in mm.
  std::vector<int32_t> regions;
  std::vector<float> free_rest;
  std::vector<float> fixed_rest;
  std::vector<double> handle_rest;

  // How poses become factors of columns. Matrices are column-major, as products with them are
  // fastest; bytes hold them row by row.
  std::vector<double> origins;        // of gradient_field a point each handle, otherwise one
  std::vector<double> centroids;      // of neo_hookean: the middle of every handle
  std::vector<double> nodes;          // of gradient_field: harmonic values, a node's side by side
  std::vector<double> interpolation;  // from values at the nodes to coefficients
  std::vector<double> simplex_low;
  std::vector<double> guard_gains;

  // Compressed columns of gradient_field (a row for each free vertex) and linear_elastic (three).
  std::vector<double> map;  // #columns by #factors
  std::vector<double> gains;
  std::vector<float> cut_map;  // any number of rows by #factors
  std::vector<float> tail;     // #factors
  // Of neo_hookean the columns of all clusters, one cluster after the other, three rows a vertex.
  PackedColumns columns;

  // Of neo_hookean.
  PackedColumns cluster_map;              // #columns of all clusters by #factors
  std::vector<int32_t> clusters;          // of each: vertices, columns, columns with lower halves
  std::vector<int32_t> cluster_vertices;  // their numbers among the free ones
  std::vector<double> first_gains;
  std::vector<double> second_gains;
  std::vector<float> probes;  // three rows for each by #pairs
  // With a third order: any number of rows by #pairs, and by #triples; gains of the triples.
  std::vector<float> second_lengths;
  std::vector<float> third_lengths;
  std::vector<double> third_gains;

  // Of linear_elastic with contact: of every unilateral row the gap at rest (mm), how the 12
  // #handles coefficients of poses change it, and how forces do (mm per Pa mm^2, symmetric). The
  // forces are the last factors of the columns.
  std::vector<double> contact_gaps;
  std::vector<double> contact_gap_map;     // #rows by 12 #handles
  std::vector<double> contact_compliance;  // #rows by #rows

  // With contact, where the lips are sealed: how the heights (mm) of the edges' vertices change
  // with the coefficients of poses and with contact forces, the forces that a unit of height takes
  // (Pa mm^2 per mm, symmetric), and how far the edges may be parted (mm, one number). The seal's
  // forces, one per pair, are then the last factors of the columns. See docs/prepared-answers.md.
  std::vector<double> seal_upper_map;     // #pairs by 12 #handles
  std::vector<double> seal_upper_forces;  // #pairs by #rows
  std::vector<double> seal_lower_map;     // #pairs by 12 #handles
  std::vector<double> seal_lower_forces;  // #pairs by #rows
  std::vector<double> seal_stiffness;     // #pairs by #pairs
  std::vector<double> seal_release;

  // Of the elastic models where ranges of the material are known: how the free vertices' answer
  // changes with each variable, three rows a vertex, those of all variables one after the other;
  // upper halves only. band_map is #columns by 12 #handles.
  std::vector<double> band_map;
  PackedColumns band;
};

// Calls visit(number, what) for all that travels, in the order of the bytes. The numbers are those
// of the sections in docs/prepared-answers.md and stay.
template <typename Answers, typename Visitor>
void VisitSections(Answers& answers, const Visitor& visit) {
  visit(2, answers.regions);
  visit(3, answers.free_rest);
  visit(4, answers.fixed_rest);
  visit(5, answers.handle_rest);
  visit(10, answers.origins);
  visit(11, answers.centroids);
  visit(12, answers.nodes);
  visit(13, answers.interpolation);
  visit(14, answers.simplex_low);
  visit(15, answers.guard_gains);
  visit(20, answers.map);
  visit(21, answers.gains);
  visit(22, answers.cut_map);
  visit(23, answers.tail);
  visit(24, answers.columns.steps);
  visit(25, answers.columns.upper);
  visit(26, answers.columns.lower);
  visit(30, answers.cluster_map.steps);
  visit(31, answers.cluster_map.upper);
  visit(32, answers.cluster_map.lower);
  visit(33, answers.clusters);
  visit(34, answers.cluster_vertices);
  visit(40, answers.first_gains);
  visit(41, answers.second_gains);
  visit(42, answers.probes);
  visit(43, answers.second_lengths);
  visit(44, answers.third_lengths);
  visit(45, answers.third_gains);
  visit(50, answers.contact_gaps);
  visit(51, answers.contact_gap_map);
  visit(52, answers.contact_compliance);
  visit(53, answers.seal_upper_map);
  visit(54, answers.seal_upper_forces);
  visit(55, answers.seal_lower_map);
  visit(56, answers.seal_lower_forces);
  visit(57, answers.seal_stiffness);
  visit(58, answers.seal_release);
  visit(60, answers.band_map);
  visit(61, answers.band.steps);
  visit(62, answers.band.upper);
}

}  // namespace tissueform
