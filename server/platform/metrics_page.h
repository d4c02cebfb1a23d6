// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>

#include "absl/status/status.h"

#include "core/base/duration_histogram.h"

namespace tissueform {

// The page of metrics that a Prometheus server reads from a program. Each value is read when the
// page is requested: code that counts keeps plain numbers and knows nothing of the page.
//
// Names are families: several of one name have different values of the same labels. No label's
// value comes from a client.
class MetricsPage {
 public:
  using Labels = std::map<std::string, std::string>;
  // Called by threads of the page, several at a time, until the page ends. Must not block. NaN:
  // there is no value, and the line is left out.
  using Read = std::function<double()>;

  // The page is empty and not yet served.
  MetricsPage();
  // Waits for readers that are under way.
  ~MetricsPage();
  MetricsPage(const MetricsPage&) = delete;
  MetricsPage& operator=(const MetricsPage&) = delete;

  // Before Serve. `help` is one sentence; of a name that comes again the first one counts.
  // REQUIRES: the name is a metric's, those of counters end in _total.
  void AddCounter(const std::string& name, const std::string& help, Labels labels, Read read);
  void AddGauge(const std::string& name, const std::string& help, Labels labels, Read read);
  // In seconds. `histogram` must outlive the page.
  void AddHistogram(const std::string& name, const std::string& help, Labels labels,
                    const DurationHistogram* histogram);

  // Serves it as http://127.0.0.1:PORT/metrics, to this machine alone, until it ends; port 0 takes
  // a free one. Once. Errors: Unavailable, naming the port.
  absl::Status Serve(int port);
  // 0 while it is not served.
  int port() const;

  // As it is served.
  std::string Text() const;

 private:
  class Families;
  class Server;

  const std::shared_ptr<Families> families_;
  std::unique_ptr<Server> server_;
};

}  // namespace tissueform
