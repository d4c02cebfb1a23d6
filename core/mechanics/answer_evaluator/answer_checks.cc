// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/answer_evaluator/answer_checks.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <type_traits>

#include "core/mechanics/answer_evaluator/answer_sizes.h"

namespace tissueform {
namespace {

constexpr double kMaxOfAnything = 1 << 28;  // fits into int32_t, and products of two into size_t
constexpr double kMaxHandles = 10000;
constexpr double kMaxDegree = 1000;
constexpr size_t kMaxUnilateralRows = 1000;  // of which a pose may take seconds at worst
constexpr size_t kMaxBandVariables = 17;     // 16 tissues and Poisson's ratio

bool IsCount(double value, double least, double most) {
  return value >= least && value <= most && value == std::floor(value);
}

bool IsFiniteAndNotNegative(double value) { return std::isfinite(value) && value >= 0; }

bool NumbersAreInRange(const AnswerNumbers& numbers) {
  using List = std::array<double, sizeof(AnswerNumbers) / sizeof(double)>;
  const List list = std::bit_cast<List>(numbers);
  return std::all_of(list.begin(), list.end(), IsFiniteAndNotNegative) &&
         IsCount(numbers.model, 1, 3) && IsCount(numbers.num_vertices, 1, kMaxOfAnything) &&
         IsCount(numbers.num_handles, 1, kMaxHandles) &&
         IsCount(numbers.num_polynomials, 0, kMaxOfAnything) &&
         IsCount(numbers.degree, 0, kMaxDegree) && numbers.tolerance_mm > 0;
}

bool AllAreFinite(const PortableAnswers& answers) {
  bool finite = true;
  VisitSections(answers, [&finite](uint32_t /*number*/, const auto& values) {
    using Value = typename std::remove_cvref_t<decltype(values)>::value_type;
    if constexpr (std::is_floating_point_v<Value>) {
      finite = finite && std::all_of(values.begin(), values.end(),
                                     [](Value value) { return std::isfinite(value); });
    }
  });
  return finite;
}

bool VerticesFit(const PortableAnswers& answers) {
  const std::vector<int32_t>& regions = answers.regions;
  const auto handles = static_cast<int32_t>(answers.numbers.num_handles);
  if (static_cast<double>(regions.size()) != answers.numbers.num_vertices) return false;
  if (std::any_of(regions.begin(), regions.end(), [handles](int32_t region) {
        return region < PortableAnswers::kFree || region >= handles;
      })) {
    return false;
  }
  const auto count = [&regions](int32_t region) {
    return static_cast<size_t>(std::count(regions.begin(), regions.end(), region));
  };
  const size_t free = count(PortableAnswers::kFree);
  const size_t fixed = count(PortableAnswers::kFixed);
  return answers.free_rest.size() == 3 * free && answers.fixed_rest.size() == 3 * fixed &&
         answers.handle_rest.size() == 3 * (regions.size() - free - fixed);
}

// `rows` by `cols`, with lower halves of some columns.
bool IsPacked(const PackedColumns& packed, size_t rows, size_t cols) {
  return packed.steps.size() == cols && packed.upper.size() == rows * cols &&
         packed.lower.size() <= packed.upper.size() &&
         (rows == 0 || packed.lower.size() % rows == 0);
}

// What one model has and another has not.
bool HasNothingElse(const PortableAnswers& answers, bool is_gradient, bool is_neo) {
  const bool no_expansion = answers.nodes.empty() && answers.interpolation.empty() &&
                            answers.simplex_low.empty() && answers.guard_gains.empty();
  const bool no_compression = answers.map.empty() && answers.gains.empty() &&
                              answers.cut_map.empty() && answers.tail.empty();
  const bool no_clusters = answers.centroids.empty() && answers.clusters.empty() &&
                           answers.cluster_vertices.empty() && answers.first_gains.empty() &&
                           answers.second_gains.empty() && answers.probes.empty() &&
                           answers.second_lengths.empty() && answers.third_lengths.empty() &&
                           answers.third_gains.empty() && IsPacked(answers.cluster_map, 0, 0);
  return (is_gradient || no_expansion) && (is_neo ? no_compression : no_clusters);
}

// How many polynomials of so many harmonic values there are up to a degree: the binomial
// coefficient (dimension + degree) over dimension. Of more than are possible, too many.
double NumPolynomials(double dimension, double degree) {
  double count = 1;
  for (int i = 1; i <= degree && count < kMaxOfAnything; ++i) count *= (dimension + i) / i;
  return std::round(count);
}

// Two degrees are expanded beyond those that are answered with, and those of the first one have
// gains.
bool ExpansionFits(const PortableAnswers& answers, const AnswerSizes& sizes) {
  const AnswerNumbers& numbers = answers.numbers;
  const auto nodes = static_cast<double>(sizes.nodes);
  const double with_gains =
      numbers.num_polynomials + static_cast<double>(answers.guard_gains.size());
  return numbers.degree >= 2 && nodes == NumPolynomials(numbers.num_handles, numbers.degree) &&
         with_gains == NumPolynomials(numbers.num_handles, numbers.degree - 1) &&
         numbers.num_polynomials == NumPolynomials(numbers.num_handles, numbers.degree - 2) &&
         numbers.simplex_width > 0 && answers.origins.size() == 3 * sizes.handles &&
         answers.nodes.size() == sizes.nodes * sizes.handles &&
         answers.interpolation.size() == sizes.nodes * sizes.nodes &&
         answers.simplex_low.size() == sizes.handles;
}

bool CompressionFits(const PortableAnswers& answers, const AnswerSizes& sizes) {
  return answers.tail.size() == sizes.factors && answers.gains.size() == sizes.columns &&
         answers.map.size() == sizes.columns * sizes.factors &&
         answers.cut_map.size() % sizes.factors == 0 &&
         IsPacked(answers.columns, sizes.rows, sizes.columns);
}

// Entries of the columns of clusters, before the upper halves' end and the lower ones'.
bool ClustersFit(const PortableAnswers& answers, const AnswerSizes& sizes) {
  size_t vertices = 0;
  size_t columns = 0;
  size_t upper = 0;
  size_t lower = 0;
  if (answers.clusters.size() % 3 != 0) return false;
  for (size_t k = 0; k < answers.clusters.size(); k += 3) {
    const int32_t* const cluster = answers.clusters.data() + k;
    if (cluster[0] < 0 || cluster[2] < 0 || cluster[1] < cluster[2]) return false;
    const auto rows = 3 * static_cast<size_t>(cluster[0]);
    vertices += static_cast<size_t>(cluster[0]);
    columns += static_cast<size_t>(cluster[1]);
    upper += rows * static_cast<size_t>(cluster[1]);
    lower += rows * static_cast<size_t>(cluster[2]);
    if (vertices > sizes.free || columns > sizes.columns) return false;
  }
  std::vector<bool> seen(sizes.free, false);
  for (const int32_t v : answers.cluster_vertices) {
    if (v < 0 || static_cast<size_t>(v) >= sizes.free || seen[static_cast<size_t>(v)]) return false;
    seen[static_cast<size_t>(v)] = true;
  }
  return vertices == sizes.free && answers.cluster_vertices.size() == sizes.free &&
         columns == sizes.columns && answers.columns.upper.size() == upper &&
         answers.columns.lower.size() == lower &&
         IsPacked(answers.cluster_map, sizes.columns, sizes.factors);
}

// All of it or nothing.
bool ThirdOrderFits(const PortableAnswers& answers, const AnswerSizes& sizes) {
  if (sizes.triples == 0) return answers.second_lengths.empty() && answers.third_gains.empty();
  return answers.second_lengths.size() % sizes.pairs == 0 &&
         answers.third_lengths.size() % sizes.triples == 0 &&
         answers.third_gains.size() == sizes.triples;
}

bool SeriesFits(const PortableAnswers& answers, const AnswerSizes& sizes) {
  return answers.origins.size() == 3 && answers.centroids.size() == 3 * sizes.handles &&
         answers.first_gains.size() == 6 * sizes.handles && answers.numbers.size_mm > 0 &&
         answers.second_gains.size() == sizes.pairs &&
         answers.probes.size() % (3 * sizes.pairs) == 0 && ThirdOrderFits(answers, sizes);
}

// Only of linear_elastic. Of the compliance no more is asked than the solver needs to end.
bool ContactFits(const PortableAnswers& answers, const AnswerSizes& sizes) {
  const size_t rows = answers.contact_gaps.size();
  const auto is_negative = [](double gap_mm) { return gap_mm < 0; };
  if (rows > kMaxUnilateralRows || answers.contact_gap_map.size() != rows * 12 * sizes.handles ||
      answers.contact_compliance.size() != rows * rows ||
      std::any_of(answers.contact_gaps.begin(), answers.contact_gaps.end(), is_negative)) {
    return false;
  }
  for (size_t row = 0; row < rows; ++row) {
    if (answers.contact_compliance[row * (rows + 1)] <= 0) return false;
  }
  return rows == 0 || IsModel(answers, AnswerModel::kLinearElastic);
}

// All of it or nothing, and only with contact.
bool SealFits(const PortableAnswers& answers, const AnswerSizes& sizes) {
  const size_t pairs = sizes.seal_pairs;
  const size_t rows = sizes.contacts;
  return answers.seal_upper_map.size() == 12 * sizes.handles * pairs &&
         answers.seal_lower_map.size() == 12 * sizes.handles * pairs &&
         answers.seal_upper_forces.size() == rows * pairs &&
         answers.seal_lower_forces.size() == rows * pairs &&
         answers.seal_stiffness.size() == pairs * pairs &&
         answers.seal_release.size() == (pairs == 0 ? 0 : 1) && pairs <= rows;
}

// Only where there are columns of elasticity.
bool BandFits(const PortableAnswers& answers, const AnswerSizes& sizes, bool is_gradient) {
  const PackedColumns& band = answers.band;
  if (band.steps.empty()) return answers.band_map.empty() && band.upper.empty();
  return !is_gradient && answers.band_map.size() == band.steps.size() * 12 * sizes.handles &&
         sizes.band_variables <= kMaxBandVariables && (sizes.free == 0 || !band.upper.empty()) &&
         IsPacked(band, 3 * sizes.free * sizes.band_variables, band.steps.size());
}

}  // namespace

std::string CheckAnswers(const PortableAnswers& answers) {
  if (!NumbersAreInRange(answers.numbers))
    return "a number of the prepared answers is out of range";
  if (!AllAreFinite(answers)) return "a value of the prepared answers is not finite";
  if (!VerticesFit(answers)) return "regions and rest positions do not fit together";
  const AnswerSizes sizes = SizesOf(answers);
  const bool is_gradient = IsModel(answers, AnswerModel::kGradientField);
  const bool is_neo = IsModel(answers, AnswerModel::kNeoHookean);
  if (!HasNothingElse(answers, is_gradient, is_neo)) return "a section belongs to another model";
  if (!ContactFits(answers, sizes)) return "the contact's sizes do not fit";
  if (!SealFits(answers, sizes)) return "the lip seal's sizes do not fit";
  if (!BandFits(answers, sizes, is_gradient)) return "the band's sizes do not fit";
  if (is_gradient && !ExpansionFits(answers, sizes)) return "the expansion's sizes do not fit";
  if (is_neo) {
    if (!SeriesFits(answers, sizes)) return "the series' sizes do not fit";
    return ClustersFit(answers, sizes) ? "" : "the clusters' sizes do not fit";
  }
  if (!is_gradient && answers.origins.size() != 3) return "there is no origin of the columns";
  return CompressionFits(answers, sizes) ? "" : "the columns' sizes do not fit";
}

}  // namespace tissueform
