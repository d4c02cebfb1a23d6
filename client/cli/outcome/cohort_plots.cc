// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/outcome/cohort_plots.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "core/planning/plan_report/html_text.h"

namespace tissueform {
namespace {

constexpr double kLeft = 55;
constexpr double kRight = 445;
constexpr double kTop = 34;
constexpr double kBottom = 270;
// Okabe and Ito's, which users with a color vision deficiency can distinguish.
constexpr std::array<const char*, 6> kColors = {"#0072b2", "#d55e00", "#009e73",
                                                "#cc79a7", "#e69f00", "#56b4e9"};

// Values of an axis with steps of 1, 2 or 5 times a power of ten.
struct Axis {
  double low;
  double high;
  double step;
};

Axis AxisFor(double low, double high) {
  const double span = std::max(high - low, 0.1);
  const double power = std::pow(10, std::floor(std::log10(span / 4)));
  const double fraction = span / 4 / power;
  const double step = power * (fraction < 2 ? 1 : fraction < 5 ? 2 : 5);
  return {std::floor(low / step) * step, std::ceil((low + span) / step) * step, step};
}

// A frame with two axes, and where values are in it.
class Plot {
 public:
  Plot(const std::string& title, const Axis& x, const Axis& y) : x_(x), y_(y) {
    absl::StrAppendFormat(
        &svg_,
        "<svg viewBox=\"0 0 460 320\" role=\"img\" style=\"width:460px;max-width:100%%\" "
        "font-size=\"12\" font-family=\"sans-serif\">\n<title>%s</title>\n"
        "<text x=\"%g\" y=\"20\" font-size=\"14\" font-weight=\"600\">%s</text>\n",
        EscapeHtml(title), kLeft, EscapeHtml(title));
    for (int i = 0; i <= StepsOf(x); ++i) DrawStepOfX(x.low + i * x.step);
    for (int i = 0; i <= StepsOf(y); ++i) DrawStepOfY(y.low + i * y.step);
  }

  double X(double value) const {
    return kLeft + (value - x_.low) / (x_.high - x_.low) * (kRight - kLeft);
  }
  double Y(double value) const {
    return kBottom - (value - y_.low) / (y_.high - y_.low) * (kBottom - kTop);
  }

  void Line(double x1, double y1, double x2, double y2, const std::string& style) {
    absl::StrAppendFormat(&svg_, "<line x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\" %s/>\n",
                          X(x1), Y(y1), X(x2), Y(y2), style);
  }
  void Text(double x, double y, const std::string& anchor, const std::string& text) {
    absl::StrAppendFormat(&svg_, "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\">%s</text>\n", x, y,
                          anchor, EscapeHtml(text));
  }
  void Dot(double x, double y) {
    absl::StrAppendFormat(&svg_,
                          "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"3\" fill=\"%s\" "
                          "fill-opacity=\"0.6\"/>\n",
                          X(x), Y(y), kColors[0]);
  }
  void Add(const std::string& element) { svg_ += element; }

  std::string Finish(const std::string& x_label, const std::string& y_label) {
    Text((kLeft + kRight) / 2, kBottom + 36, "middle", x_label);
    absl::StrAppendFormat(&svg_,
                          "<text transform=\"translate(14 %.0f) rotate(-90)\" "
                          "text-anchor=\"middle\">%s</text>\n</svg>\n",
                          (kTop + kBottom) / 2, EscapeHtml(y_label));
    return svg_;
  }

  const Axis& x() const { return x_; }

 private:
  static int StepsOf(const Axis& axis) {
    return static_cast<int>(std::lround((axis.high - axis.low) / axis.step));
  }
  static std::string Label(double value) { return absl::StrFormat("%.3g", value + 0.0); }

  void DrawStepOfX(double value) {
    Line(value, y_.low, value, y_.high, "stroke=\"#dde3e9\"");
    Text(X(value), kBottom + 16, "middle", Label(value));
  }
  void DrawStepOfY(double value) {
    Line(x_.low, value, x_.high, value, "stroke=\"#dde3e9\"");
    Text(kLeft - 6, Y(value) + 4, "end", Label(value));
  }

  const Axis x_;
  const Axis y_;
  std::string svg_;
};

// Steps up at each value by one of their number.
std::string StepsPath(const Plot& plot, std::vector<double> values) {
  std::ranges::sort(values);
  std::string path = absl::StrFormat("M%.1f %.1f", plot.X(plot.x().low), plot.Y(0));
  for (size_t i = 0; i < values.size(); ++i) {
    const double share = 100 * static_cast<double>(i + 1) / static_cast<double>(values.size());
    absl::StrAppendFormat(&path, "H%.1fV%.1f", plot.X(values[i]), plot.Y(share));
  }
  absl::StrAppendFormat(&path, "H%.1f", plot.X(plot.x().high));
  return path;
}

double LargestOf(const std::vector<NamedValues>& curves) {
  double largest = 2;  // mm: what the field accepts is always in the picture
  for (const NamedValues& curve : curves) {
    for (const double value : curve.values) largest = std::max(largest, value);
  }
  return largest;
}

}  // namespace

std::string CumulativePlot(const std::string& title, const std::vector<NamedValues>& curves) {
  Plot plot(title, AxisFor(0, LargestOf(curves)), {0, 100, 20});
  for (size_t c = 0; c < curves.size(); ++c) {
    const char* color = kColors[c % kColors.size()];
    plot.Add(absl::StrFormat("<path d=\"%s\" fill=\"none\" stroke=\"%s\" stroke-width=\"2\"/>\n",
                             StepsPath(plot, curves[c].values), color));
    const double y = kBottom - 14 - 16 * static_cast<double>(curves.size() - 1 - c);
    plot.Add(
        absl::StrFormat("<rect x=\"%.0f\" y=\"%.0f\" width=\"10\" height=\"10\" fill=\"%s\"/>\n",
                        kRight - 130, y - 9, color));
    plot.Text(kRight - 115, y, "start", curves[c].name);
  }
  return plot.Finish("mean absolute distance [mm]", "patients [%]");
}

std::string AgreementPlot(const std::string& title, const std::vector<MeasuredPair>& pairs,
                          const Agreement& agreement) {
  Interval x = {pairs.front().real, pairs.front().real};
  Interval y = {std::min(agreement.low, 0.0), std::max(agreement.high, 0.0)};
  for (const MeasuredPair& pair : pairs) {
    const double mean = (pair.predicted + pair.real) / 2;
    x = {std::min(x.low, mean), std::max(x.high, mean)};
    y.low = std::min(y.low, pair.predicted - pair.real);
    y.high = std::max(y.high, pair.predicted - pair.real);
  }
  Plot plot(title, AxisFor(x.low, x.high), AxisFor(y.low, y.high));
  const Axis& axis = plot.x();
  plot.Line(axis.low, agreement.bias, axis.high, agreement.bias, "stroke=\"#1c2733\"");
  for (const double limit : {agreement.low, agreement.high}) {
    plot.Line(axis.low, limit, axis.high, limit, "stroke=\"#d55e00\" stroke-dasharray=\"6 4\"");
  }
  for (const MeasuredPair& pair : pairs) {
    plot.Dot((pair.predicted + pair.real) / 2, pair.predicted - pair.real);
  }
  return plot.Finish("mean of predicted and real movement [mm]", "predicted - real [mm]");
}

}  // namespace tissueform
