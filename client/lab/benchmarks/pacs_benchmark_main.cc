// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// How fast the PACS bridge receives, from processes of DCMTK's storescu; and DCMTK's own storescp,
// in turns.

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "CLI/CLI.hpp"
#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <nlohmann/json.hpp>

#include "client/cli/shared/circumstances.h"
#include "client/pacs_bridge/dicom/dicom_file.h"
#include "client/pacs_bridge/dicom/dicom_uid.h"
#include "client/pacs_bridge/network/listening_socket.h"
#include "client/pacs_bridge/network/storage_receiver.h"
#include "core/base/atomic_file.h"
#include "core/base/process/guarded_program.h"
#include "core/base/status_macros.h"
#include "core/imaging/series/image_header.h"

namespace tissueform::benchmarks {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr int kEdge = 512;  // pixels of a slice, of two bytes
constexpr int kMany = 20;   // associations at once

struct Options {
  int slices = 150;  // of one association
  int associations = 4;
  int repetitions = 3;
  std::string json;
};

class CountingSink : public InstanceSink {
 public:
  absl::Status Keep(const ReceivedInstance& /*instance*/) override { return absl::OkStatus(); }
  void AssociationEnded(const EndedAssociation& /*ended*/) override {}
};

// A folder of slices with noise, which nothing compresses, for every association.
absl::Status WriteSlices(const fs::path& home, int folders, int slices) {
  TF_RETURN_IF_ERROR(PrepareDcmtk());
  std::mt19937 noise(4711);
  std::vector<Uint16> pixels(size_t{kEdge} * kEdge);
  for (int folder = 0; folder < folders; ++folder) {
    const fs::path path = home / absl::StrCat("sent", folder);
    fs::create_directories(path);
    const std::string series = NewDicomUid();
    for (int slice = 0; slice < slices; ++slice) {
      DcmFileFormat file;
      DcmDataset* dataset = file.getDataset();
      for (Uint16& pixel : pixels) pixel = static_cast<Uint16>(noise() & 0xFFF);
      dataset->putAndInsertString(DCM_SOPClassUID, std::string(kCtImageClass).c_str());
      dataset->putAndInsertString(DCM_SOPInstanceUID, NewDicomUid().c_str());
      dataset->putAndInsertString(DCM_StudyInstanceUID, series.c_str());
      dataset->putAndInsertString(DCM_SeriesInstanceUID, series.c_str());
      dataset->putAndInsertUint16(DCM_Rows, kEdge);
      dataset->putAndInsertUint16(DCM_Columns, kEdge);
      dataset->putAndInsertUint16(DCM_BitsAllocated, 16);
      dataset->putAndInsertUint16Array(DCM_PixelData, pixels.data(), pixels.size());
      if (file.saveFile((path / absl::StrCat(slice)).c_str(), EXS_LittleEndianExplicit).bad()) {
        return absl::ResourceExhaustedError(absl::StrCat(path.string(), ": cannot be written"));
      }
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<GuardedProgram>> StartProgram(
    const std::string& name, const std::vector<std::string>& arguments,
    const std::vector<std::string>& environment = {}) {
  ChildOptions options;
  options.program = name;
  options.arguments = arguments;
  options.environment = environment;
  options.output = ChildStream::Null();
  options.errors = ChildStream::Null();
  return GuardedProgram::Start(options, std::chrono::seconds(1));
}

// Sends every folder in an association of its own, at once; slices a second.
absl::StatusOr<double> SendAll(const fs::path& home, int folders, int slices, int port) {
  const auto begin = std::chrono::steady_clock::now();
  std::vector<std::unique_ptr<GuardedProgram>> senders;
  for (int folder = 0; folder < folders; ++folder) {
    TF_ASSIGN_OR_RETURN(senders.emplace_back(),
                        StartProgram("storescu", {"-aet", "SCANNER", "-aec", "TISSUEFORM", "-xe",
                                                  "127.0.0.1", absl::StrCat(port), "+sd",
                                                  (home / absl::StrCat("sent", folder)).string()}));
  }
  for (const auto& sender : senders) {
    if (sender->Wait().exit_code != 0) return absl::InternalError("storescu failed");
  }
  const std::chrono::duration<double> time = std::chrono::steady_clock::now() - begin;
  return folders * slices / time.count();
}

// Ours: every file whole, synced and shown to a sink before it is answered.
absl::StatusOr<double> TimeOurs(const fs::path& home, int folders, int slices) {
  const fs::path received = home / "received";
  fs::create_directories(received);
  CountingSink sink;
  TF_ASSIGN_OR_RETURN(const auto folder,
                      InstanceFolder::Open({.path = received, .watermark_bytes = 0}));
  ReceiverOptions options;
  options.calling_ae_titles = {"SCANNER"};
  TF_ASSIGN_OR_RETURN(const auto receiver, StorageReceiver::Start(options, folder.get(), &sink));
  const absl::StatusOr<double> rate = SendAll(home, folders, slices, receiver->port());
  const int64_t kept = receiver->Counts().kept;
  receiver->Stop();
  fs::remove_all(received);
  if (rate.ok() && kept != int64_t{folders} * slices) {
    return absl::InternalError(absl::StrCat(kept, " slices were received"));
  }
  return rate;
}

// DCMTK's receiver, a process for every association; files are not synced.
absl::StatusOr<double> TimePeer(const fs::path& home, int folders, int slices,
                                const std::vector<std::string>& environment) {
  const fs::path received = home / "peer";
  fs::create_directories(received);
  int port = 0;
  {
    TF_ASSIGN_OR_RETURN(const ListeningSocket free, ListeningSocket::Listen("127.0.0.1", 0));
    port = free.port();
  }
  TF_ASSIGN_OR_RETURN(const auto peer, StartProgram("storescp",
                                                    {"--fork", "+B", "-aet", "TISSUEFORM", "-od",
                                                     received.string(), absl::StrCat(port)},
                                                    environment));
  // It listens when an echo comes back.
  for (int tries = 0; tries < 200; ++tries) {
    TF_ASSIGN_OR_RETURN(const auto echo,
                        StartProgram("echoscu", {"127.0.0.1", absl::StrCat(port)}));
    if (echo->Wait().exit_code == 0) break;
  }
  const absl::StatusOr<double> rate = SendAll(home, folders, slices, port);
  fs::remove_all(received);
  return rate;
}

// Of this process, which receives and makes the slices: the most that it ever had.
double PeakMebibytes() {
  std::ifstream status("/proc/self/status");
  int64_t kibibytes = 0;
  for (std::string line; std::getline(status, line);) {
    if (absl::StartsWith(line, "VmHWM:")) {
      std::string digits;
      for (const char c : line) {
        if (absl::ascii_isdigit(static_cast<unsigned char>(c))) digits.push_back(c);
      }
      if (!absl::SimpleAtoi(digits, &kibibytes)) return 0;
    }
  }
  return static_cast<double>(kibibytes) / 1024;
}

double Median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

absl::StatusOr<Json> Measure(const Options& options, const fs::path& home) {
  TF_RETURN_IF_ERROR(WriteSlices(home, options.associations, options.slices));
  std::vector<double> ours;
  std::vector<double> peer;
  std::vector<double> peer_without_delay;
  for (int i = 0; i < options.repetitions; ++i) {
    TF_ASSIGN_OR_RETURN(ours.emplace_back(), TimeOurs(home, options.associations, options.slices));
    TF_ASSIGN_OR_RETURN(peer.emplace_back(),
                        TimePeer(home, options.associations, options.slices, {}));
    TF_ASSIGN_OR_RETURN(peer_without_delay.emplace_back(),
                        TimePeer(home, options.associations, options.slices, {"TCP_NODELAY=1"}));
  }
  const int few = std::max(1, options.slices / 10);
  for (int i = 0; i < options.associations; ++i) {
    fs::remove_all(home / absl::StrCat("sent", i));
  }
  TF_RETURN_IF_ERROR(WriteSlices(home, kMany, few));
  TF_ASSIGN_OR_RETURN(const double many, TimeOurs(home, kMany, few));
  const Circumstances circumstances = MeasuringCircumstances();
  return Json{{"machine", circumstances.machine},
              {"compiler", circumstances.compiler},
              {"commit", circumstances.commit},
              {"repetitions", options.repetitions},
              {"associations", options.associations},
              {"slices", options.associations * options.slices},
              {"slice_bytes", 2 * kEdge * kEdge},
              {"ours_per_second", Median(ours)},
              {"storescp_per_second", Median(peer)},
              {"ratio", Median(ours) / Median(peer)},
              {"storescp_nodelay_per_second", Median(peer_without_delay)},
              {"ratio_nodelay", Median(ours) / Median(peer_without_delay)},
              {"twenty_associations_per_second", many},
              {"peak_mib", PeakMebibytes()}};
}

int Run(const Options& options) {
  std::string home = (fs::temp_directory_path() / "tissueform-pacs-XXXXXX").string();
  if (mkdtemp(home.data()) == nullptr) {
    std::cerr << "tissueform-pacs-benchmark: no temporary folder\n";
    return 1;
  }
  const absl::StatusOr<Json> result = Measure(options, home);
  fs::remove_all(home);
  if (!result.ok()) {
    std::cerr << "tissueform-pacs-benchmark: " << result.status().message() << "\n";
    return 1;
  }
  std::cout << absl::StrFormat(
      "%d associations, slices of 512 x 512, medians of %d\n"
      "ours, synced               %8.0f a second\n"
      "storescp                   %8.0f a second (ratio %.1f)\n"
      "storescp, TCP_NODELAY=1    %8.0f a second (ratio %.2f)\n"
      "ours, %d associations      %8.0f a second\n"
      "peak memory                %8.0f MiB\n",
      options.associations, options.repetitions, (*result)["ours_per_second"].get<double>(),
      (*result)["storescp_per_second"].get<double>(), (*result)["ratio"].get<double>(),
      (*result)["storescp_nodelay_per_second"].get<double>(),
      (*result)["ratio_nodelay"].get<double>(), kMany,
      (*result)["twenty_associations_per_second"].get<double>(),
      (*result)["peak_mib"].get<double>());
  if (options.json.empty()) return 0;
  const absl::Status written = WriteFileAtomically(options.json, result->dump(2) + "\n");
  if (!written.ok()) std::cerr << "tissueform-pacs-benchmark: " << written.message() << "\n";
  return written.ok() ? 0 : 1;
}

}  // namespace
}  // namespace tissueform::benchmarks

int main(int argc, char** argv) {
  CLI::App app(
      "Measures how many slices per second the PACS bridge receives, compared with DCMTK's "
      "storescp");
  tissueform::benchmarks::Options options;
  app.add_option("--slices", options.slices, "of each association")
      ->check(CLI::Range(1, 10'000))
      ->capture_default_str();
  app.add_option("--associations", options.associations, "at once")
      ->check(CLI::Range(1, 32))
      ->capture_default_str();
  app.add_option("--repetitions", options.repetitions, "repetitions of each receiver, alternating")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  app.add_option("--json", options.json, "the figures as a file");
  CLI11_PARSE(app, argc, argv);
  return tissueform::benchmarks::Run(options);
}
