// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/metrics_page.h"

#include <cmath>
#include <dlfcn.h>
#include <exception>
#include <limits>
#include <pthread.h>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

#include "prometheus/collectable.h"
#include "prometheus/exposer.h"
#include "prometheus/metric_family.h"
#include "prometheus/text_serializer.h"

// The library's web server, CivetWeb, gives its threads stacks of 100 KiB, of which the C library
// takes the thread-local storage of all libraries: 90 KiB in a server with OpenBLAS and METIS. The
// first request would end the process. So no thread of the program gets less than this; pages that
// are not touched cost nothing.
extern "C" __attribute__((visibility("default"))) int pthread_attr_setstacksize(
    pthread_attr_t* attributes, size_t size) noexcept {
  constexpr size_t kLeastStackBytes = size_t{1} << 20;
  static const auto set = reinterpret_cast<int (*)(pthread_attr_t*, size_t)>(
      dlsym(RTLD_NEXT, "pthread_attr_setstacksize"));
  return set(attributes, size < kLeastStackBytes ? kLeastStackBytes : size);
}

namespace tissueform {
namespace {

using prometheus::ClientMetric;
using prometheus::MetricFamily;
using prometheus::MetricType;

// A scrape is one small request; who asks for more, or slowly, is no Prometheus.
std::vector<std::string> HttpOptions(int port) {
  return {"listening_ports",     absl::StrCat("127.0.0.1:", port),
          "access_control_list", "-0.0.0.0/0,+127.0.0.0/8",
          "num_threads",         "2",
          "request_timeout_ms",  "5000",
          "max_request_size",    "4096",
          "listen_backlog",      "16"};
}

void SetValue(MetricType type, double value, ClientMetric* metric) {
  (type == MetricType::Counter ? metric->counter.value : metric->gauge.value) = value;
}

ClientMetric::Histogram ToHistogram(const DurationHistogram::Snapshot& snapshot) {
  ClientMetric::Histogram histogram;
  uint64_t count = 0;
  for (size_t i = 0; i < snapshot.counts.size(); ++i) {
    count += snapshot.counts[i];
    histogram.bucket.push_back({.cumulative_count = count,
                                .upper_bound = i < DurationHistogram::kBounds.size()
                                                   ? DurationHistogram::kBounds[i]
                                                   : std::numeric_limits<double>::infinity()});
  }
  histogram.sample_count = count;
  histogram.sample_sum = snapshot.sum_seconds;
  return histogram;
}

}  // namespace

class MetricsPage::Families : public prometheus::Collectable {
 public:
  // False: there is nothing to report.
  using Fill = std::function<bool(ClientMetric*)>;

  void Add(const std::string& name, const std::string& help, MetricType type, Labels labels,
           Fill fill) {
    Family& family = families_.try_emplace(name, Family{.help = help, .type = type}).first->second;
    family.members.push_back({std::move(labels), std::move(fill)});
  }

  void Add(const std::string& name, const std::string& help, MetricType type, Labels labels,
           Read read) {
    Add(name, help, type, std::move(labels), [read = std::move(read), type](ClientMetric* metric) {
      const double value = read();
      SetValue(type, value, metric);
      return !std::isnan(value);
    });
  }

  std::vector<MetricFamily> Collect() const override {
    std::vector<MetricFamily> collected;
    for (const auto& [name, family] : families_) {
      MetricFamily& result = collected.emplace_back(
          MetricFamily{.name = name, .help = family.help, .type = family.type, .metric = {}});
      for (const Member& member : family.members) {
        ClientMetric metric;
        for (const auto& [label, value] : member.labels) metric.label.push_back({label, value});
        if (member.fill(&metric)) result.metric.push_back(std::move(metric));
      }
      if (result.metric.empty()) collected.pop_back();
    }
    return collected;
  }

 private:
  struct Member {
    Labels labels;
    Fill fill;
  };
  struct Family {
    std::string help;
    MetricType type = MetricType::Untyped;
    std::vector<Member> members = {};
  };

  std::map<std::string, Family> families_;
};

class MetricsPage::Server {
 public:
  // Throws what the library throws.
  explicit Server(int port) : exposer_(HttpOptions(port)) {}

  prometheus::Exposer& exposer() { return exposer_; }

 private:
  prometheus::Exposer exposer_;
};

MetricsPage::MetricsPage() : families_(std::make_shared<Families>()) {}
MetricsPage::~MetricsPage() = default;

void MetricsPage::AddCounter(const std::string& name, const std::string& help, Labels labels,
                             Read read) {
  families_->Add(name, help, MetricType::Counter, std::move(labels), std::move(read));
}

void MetricsPage::AddGauge(const std::string& name, const std::string& help, Labels labels,
                           Read read) {
  families_->Add(name, help, MetricType::Gauge, std::move(labels), std::move(read));
}

void MetricsPage::AddHistogram(const std::string& name, const std::string& help, Labels labels,
                               const DurationHistogram* histogram) {
  families_->Add(name, help, MetricType::Histogram, std::move(labels),
                 Families::Fill([histogram](ClientMetric* metric) {
                   metric->histogram = ToHistogram(histogram->Read());
                   return true;
                 }));
}

absl::Status MetricsPage::Serve(int port) {
  try {
    auto server = std::make_unique<Server>(port);
    server->exposer().RegisterCollectable(families_);
    server_ = std::move(server);
  } catch (const std::exception& error) {
    return absl::UnavailableError(absl::StrCat("metrics: port ", port,
                                               " of 127.0.0.1 is not available (", error.what(),
                                               "); name another --metrics-port, or 0"));
  }
  return absl::OkStatus();
}

int MetricsPage::port() const {
  return server_ == nullptr ? 0 : server_->exposer().GetListeningPorts().front();
}

std::string MetricsPage::Text() const {
  return prometheus::TextSerializer().Serialize(families_->Collect());
}

}  // namespace tissueform
