// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/client/pacs_bridge/network/dicom_peers.h"

#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <random>
#include <thread>
#include <unistd.h>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include "client/pacs_bridge/dicom/dicom_uid.h"
#include "client/pacs_bridge/network/listening_socket.h"
#include "tests/testing/test_authority.h"

namespace tissueform::testing {
namespace {

namespace fs = std::filesystem;
constexpr std::chrono::seconds kPatience{20};
// Below those that outgoing connections and port 0 take (net.ipv4.ip_local_port_range).
constexpr int kFirstPort = 20'000;
constexpr int kLastPort = 31'999;

fs::path Find(const std::string& program) {
  if (fs::path(program).is_absolute()) return fs::exists(program) ? fs::path(program) : fs::path();
  const char* path = std::getenv("PATH");
  std::vector<std::string> folders = absl::StrSplit(path == nullptr ? "" : path, ':');
  folders.push_back("/usr/sbin");
  for (const std::string& folder : folders) {
    if (access((fs::path(folder) / program).c_str(), X_OK) == 0) return fs::path(folder) / program;
  }
  return {};
}

bool Connects(int port) {
  const int tried = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in place = {};
  place.sin_family = AF_INET;
  place.sin_port = htons(static_cast<uint16_t>(port));
  place.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const bool connected = connect(tried, reinterpret_cast<sockaddr*>(&place), sizeof(place)) == 0;
  close(tried);
  return connected;
}

}  // namespace

bool HasProgram(const std::string& program) { return !Find(program).empty(); }

ProgramEnd RunPeer(const std::string& program, const std::vector<std::string>& arguments) {
  const fs::path said = EmptyTestFolder(absl::StrCat("said_", NewDicomUid())) / "said";
  ChildOptions options;
  options.program = Find(program);
  options.arguments = arguments;
  options.output = ChildStream::File(said);
  options.errors = ChildStream::File(said);
  ProgramEnd end;
  const auto child = ChildProcess::Start(options);
  if (!child.ok()) return {-1, child.status().ToString()};
  const auto ended = (*child)->WaitFor(std::chrono::minutes(1));
  if (ended) end.exit_code = ended->exit_code;
  end.said = BytesOfFile(said);
  fs::remove_all(said.parent_path());
  return end;
}

int FreePort() {
  std::random_device random;
  std::uniform_int_distribution<int> ports(kFirstPort, kLastPort);
  for (int tries = 0; tries < 1000; ++tries) {
    const int port = ports(random);
    if (ListeningSocket::Listen("127.0.0.1", port).ok()) return port;
  }
  return 0;
}

bool WaitForPort(int port) {
  const auto until = std::chrono::steady_clock::now() + kPatience;
  while (std::chrono::steady_clock::now() < until) {
    if (Connects(port)) return true;
    std::this_thread::yield();
  }
  return false;
}

absl::Status RecordingSink::Keep(const ReceivedInstance& instance) {
  MutexLock lock(mutex_);
  if (answer_.ok()) instances_.push_back(instance);
  return answer_;
}

void RecordingSink::AssociationEnded(const EndedAssociation& ended) {
  MutexLock lock(mutex_);
  ends_.push_back(ended);
  changed_.NotifyAll();
}

void RecordingSink::Answer(absl::Status answer) {
  MutexLock lock(mutex_);
  answer_ = std::move(answer);
}

std::vector<ReceivedInstance> RecordingSink::instances() const {
  MutexLock lock(mutex_);
  return instances_;
}

std::vector<EndedAssociation> RecordingSink::WaitForEnds(size_t count) const {
  const auto until = std::chrono::steady_clock::now() + kPatience;
  MutexLock lock(mutex_);
  while (ends_.size() < count && changed_.WaitUntil(mutex_, until)) continue;
  return ends_;
}

void RecordingSink::ConnectionRefused(const RefusedConnection& refused) {
  MutexLock lock(mutex_);
  refusals_.push_back(absl::StrCat(refused.address, " ", refused.calling_ae, ": ", refused.reason));
  changed_.NotifyAll();
}

std::vector<std::string> RecordingSink::WaitForRefusals(size_t count) const {
  const auto until = std::chrono::steady_clock::now() + kPatience;
  MutexLock lock(mutex_);
  while (refusals_.size() < count && changed_.WaitUntil(mutex_, until)) continue;
  return refusals_;
}

std::string DataSetOfFile(const fs::path& path) {
  const std::string bytes = BytesOfFile(path);
  if (bytes.size() < 144) return {};
  uint32_t length = 0;
  std::memcpy(&length, bytes.data() + 140, 4);
  return bytes.substr(144 + length);
}

}  // namespace tissueform::testing
