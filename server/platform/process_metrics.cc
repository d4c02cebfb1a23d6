// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/process_metrics.h"

#include <cmath>
#include <cstdint>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <limits>
#include <system_error>
#include <unistd.h>

#include <sys/resource.h>

namespace tissueform {
namespace {

constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();

double ResidentBytes() {
  std::ifstream statm("/proc/self/statm");
  int64_t size = 0;
  int64_t resident = 0;
  if (!(statm >> size >> resident)) return kNothing;
  return static_cast<double>(resident) * static_cast<double>(sysconf(_SC_PAGE_SIZE));
}

double ProcessorSeconds() {
  timespec used = {};
  if (clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &used) != 0) return kNothing;
  return static_cast<double>(used.tv_sec) + static_cast<double>(used.tv_nsec) * 1e-9;
}

double OpenDescriptors() {
  std::error_code error;
  double count = 0;
  for (std::filesystem::directory_iterator entry("/proc/self/fd", error), end;
       !error && entry != end; entry.increment(error)) {
    ++count;
  }
  return error ? kNothing : count;
}

double MaxDescriptors() {
  rlimit limit = {};
  return getrlimit(RLIMIT_NOFILE, &limit) == 0 ? static_cast<double>(limit.rlim_cur) : kNothing;
}

}  // namespace

void AddProcessMetrics(const std::string& prefix, const std::string& version, MetricsPage* page) {
  page->AddGauge(prefix + "_build_info", "Always 1; the version is a label.",
                 {{"version", version}}, [] { return 1.0; });
  page->AddGauge("process_resident_memory_bytes", "Memory of the process.", {}, ResidentBytes);
  page->AddCounter("process_cpu_seconds_total", "Processor time that the process has taken.", {},
                   ProcessorSeconds);
  page->AddGauge("process_open_fds", "Open descriptors of the process.", {}, OpenDescriptors);
  page->AddGauge("process_max_fds", "Descriptor limit of the process.", {}, MaxDescriptors);
  page->AddGauge("process_start_time_seconds", "When the process made this page, in Unix time.", {},
                 [start = static_cast<double>(std::time(nullptr))] { return start; });
}

}  // namespace tissueform
