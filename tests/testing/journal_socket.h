// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <atomic>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <map>
#include <sstream>
#include <string>
#include <unistd.h>
#include <vector>

#include <sys/socket.h>
#include <sys/un.h>

namespace tissueform::testing {

// A path for a socket, of this process's own. Short: a socket's path has at most 107 bytes.
inline std::string NewSocketPath() {
  static std::atomic<int> count = 0;
  return "/tmp/tissueform_" + std::to_string(getpid()) + "_" + std::to_string(++count);
}

// In place of journald: a datagram socket at a path of the test's own, which is read when asked.
class JournalSocket {
 public:
  using Fields = std::map<std::string, std::string>;

  explicit JournalSocket(const std::string& path) : path_(path) {
    std::filesystem::remove(path);
    socket_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    sockaddr_un address = {};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path.c_str(), sizeof(address.sun_path) - 1);
    if (bind(socket_, reinterpret_cast<sockaddr*>(&address), sizeof(address)) != 0) std::abort();
  }
  ~JournalSocket() {
    close(socket_);
    std::filesystem::remove(path_);
  }
  JournalSocket(const JournalSocket&) = delete;
  JournalSocket& operator=(const JournalSocket&) = delete;

  // The fields of the entries that wait.
  std::vector<Fields> Entries() {
    std::vector<Fields> entries;
    std::array<char, 65536> datagram = {};
    while (true) {
      const ssize_t size = recv(socket_, datagram.data(), datagram.size(), MSG_DONTWAIT);
      if (size < 0) return entries;
      std::istringstream lines(std::string(datagram.data(), static_cast<size_t>(size)));
      Fields& fields = entries.emplace_back();
      for (std::string line; std::getline(lines, line);) {
        const size_t equals = line.find('=');
        fields[line.substr(0, equals)] = line.substr(equals + 1);
      }
    }
  }
  std::vector<std::string> Messages() {
    std::vector<std::string> messages;
    for (Fields& fields : Entries()) messages.push_back(fields["MESSAGE"]);
    return messages;
  }

 private:
  const std::string path_;
  int socket_ = -1;
};

}  // namespace tissueform::testing
