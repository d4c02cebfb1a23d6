// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/answer_evaluator/series_terms.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include "core/mechanics/answer_evaluator/small_product.h"

namespace tissueform {
namespace {

std::vector<double> PairProductsOf(const std::vector<double>& numbers) {
  std::vector<double> products;
  products.reserve(numbers.size() * (numbers.size() + 1) / 2);
  for (size_t a = 0; a < numbers.size(); ++a) {
    for (size_t b = a; b < numbers.size(); ++b) {
      products.push_back((a == b ? 1 : 2) * numbers[a] * numbers[b]);
    }
  }
  return products;
}

std::vector<double> TripleProductsOf(const std::vector<double>& numbers) {
  std::vector<double> products;
  for (size_t a = 0; a < numbers.size(); ++a) {
    for (size_t b = a; b < numbers.size(); ++b) {
      for (size_t c = b; c < numbers.size(); ++c) {
        const double orders = a == c ? 1 : a == b || b == c ? 3 : 6;
        products.push_back(orders * numbers[a] * numbers[b] * numbers[c]);
      }
    }
  }
  return products;
}

// What a column-major matrix gives of the products.
std::vector<float> ProductWith(const std::vector<float>& matrix,
                               const std::vector<double>& products) {
  if (products.empty()) return {};
  const std::vector<float> singles(products.begin(), products.end());
  std::vector<float> result(matrix.size() / products.size());
  MultiplySmall(matrix.data(), singles.data(), {result.size(), singles.size(), 1}, result.data());
  return result;
}

double LengthOf(const std::vector<float>& matrix, const std::vector<double>& products) {
  double square = 0;
  for (const float number : ProductWith(matrix, products)) square += double{number} * number;
  return std::sqrt(square);
}

// The root of the sum of the squares of what single products do.
double SingleMm(const std::vector<double>& gains, const std::vector<double>& products) {
  double square = 0;
  for (size_t p = 0; p < products.size(); ++p) {
    const double single = gains[p] * products[p];
    square += single * single;
  }
  return std::sqrt(square);
}

}  // namespace

std::vector<double> NumbersOf(const PortableAnswers& answers, std::span<const AnswerPose> poses) {
  std::vector<double> numbers;
  numbers.reserve(kNumbersPerHandle * poses.size());
  for (size_t h = 0; h < poses.size(); ++h) {
    const std::array<double, 9> R = TurnMinusIdentity(poses[h].rotation_vector, 1);
    numbers.push_back(0.5 * (R[7] - R[5]));
    numbers.push_back(0.5 * (R[2] - R[6]));
    numbers.push_back(0.5 * (R[3] - R[1]));
    const std::array<double, 3> move =
        MotionAbout(poses[h], answers.centroids.data() + 3 * h).move_mm;
    numbers.insert(numbers.end(), move.begin(), move.end());
  }
  return numbers;
}

SeriesTerms TermsOf(const PortableAnswers& answers, std::vector<double> numbers) {
  SeriesTerms terms;
  terms.numbers = std::move(numbers);
  terms.pairs = PairProductsOf(terms.numbers);
  if (answers.third_lengths.empty()) return terms;
  terms.triples = TripleProductsOf(terms.numbers);
  const double second = LengthOf(answers.second_lengths, terms.pairs);
  terms.ratio = second > 0 ? LengthOf(answers.third_lengths, terms.triples) / second : 0;
  return terms;
}

double SecondOrderErrorMm(const PortableAnswers& answers, const std::vector<double>& pairs) {
  const std::vector<float> moves = ProductWith(answers.probes, pairs);
  double farthest = 0;
  for (size_t first = 0; first < moves.size(); first += 3) {
    farthest = std::max(farthest, RowNorm(moves.data() + first, 3));
  }
  const double root = std::sqrt(farthest * SingleMm(answers.second_gains, pairs));
  return answers.numbers.estimate_scale * root * std::sqrt(root / answers.numbers.size_mm);
}

double ThirdOrderErrorMm(const PortableAnswers& answers, const std::vector<double>& triples) {
  return SingleMm(answers.third_gains, triples);
}

double SeriesErrorMm(const PortableAnswers& answers, const SeriesTerms& terms) {
  const double second = SecondOrderErrorMm(answers, terms.pairs);
  if (terms.triples.empty()) return second;
  return std::max(second, ThirdOrderErrorMm(answers, terms.triples)) * terms.ratio /
         (1 + terms.ratio);
}

double FirstOrderMm(const PortableAnswers& answers, const std::vector<double>& numbers) {
  return SingleMm(answers.first_gains, numbers);
}

}  // namespace tissueform
