// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/connection_listener.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <netdb.h>
#include <poll.h>
#include <unistd.h>
#include <utility>

#include "absl/memory/memory.h"
#include "absl/strings/str_cat.h"
#include "spdlog/spdlog.h"
#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <sys/socket.h>

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr int kBacklog = 512;
// Between two looks at a listener that has run out of descriptors, and two lines of the log.
constexpr int kPauseMilliseconds = 20;
constexpr int kLogMilliseconds = 1000;

std::string Join(const std::string& host, int port) {
  const bool is_ipv6 = host.find(':') != std::string::npos;
  return absl::StrCat(is_ipv6 ? "[" : "", host, is_ipv6 ? "]:" : ":", port);
}

absl::Status CannotListen(const ConnectionListener::Options& options, const std::string& why) {
  return absl::UnavailableError(absl::StrCat("cannot listen on ", Join(options.host, options.port),
                                             ": ", why, "; choose another ", options.chosen_by));
}

// The port that the socket has; 0 without one.
int PortOf(int fd) {
  sockaddr_storage address{};
  socklen_t size = sizeof(address);
  if (getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size) != 0) return 0;
  return ntohs(address.ss_family == AF_INET6
                   ? reinterpret_cast<const sockaddr_in6*>(&address)->sin6_port
                   : reinterpret_cast<const sockaddr_in*>(&address)->sin_port);
}

void SetPort(int port, sockaddr* address) {
  if (address->sa_family == AF_INET6) {
    reinterpret_cast<sockaddr_in6*>(address)->sin6_port = htons(static_cast<uint16_t>(port));
  } else {
    reinterpret_cast<sockaddr_in*>(address)->sin_port = htons(static_cast<uint16_t>(port));
  }
}

// Without the port. An IPv6 client has 2^64 addresses of its own: its network counts.
std::string AddressText(const sockaddr_storage& address) {
  if (address.ss_family == AF_INET6) {
    const auto* ipv6 = reinterpret_cast<const sockaddr_in6*>(&address);
    return std::string(reinterpret_cast<const char*>(&ipv6->sin6_addr), 8);
  }
  const auto* ipv4 = reinterpret_cast<const sockaddr_in*>(&address);
  return std::string(reinterpret_cast<const char*>(&ipv4->sin_addr), 4);
}

int OpenSpare() { return open("/dev/null", O_RDONLY | O_CLOEXEC); }

}  // namespace

int RaiseDescriptorLimit() {
  rlimit limit{};
  getrlimit(RLIMIT_NOFILE, &limit);
  limit.rlim_cur = limit.rlim_max;
  setrlimit(RLIMIT_NOFILE, &limit);
  getrlimit(RLIMIT_NOFILE, &limit);
  return static_cast<int>(std::min<rlim_t>(limit.rlim_cur, 1 << 20));
}

absl::StatusOr<std::unique_ptr<ConnectionListener>> ConnectionListener::Listen(
    const Options& options) {
  auto listener = absl::WrapUnique(new ConnectionListener(options));
  TF_RETURN_IF_ERROR(listener->Bind(options));
  listener->stop_fd_ = eventfd(0, EFD_CLOEXEC);
  listener->spare_fd_ = OpenSpare();
  if (listener->stop_fd_ < 0 || listener->spare_fd_ < 0) {
    return CannotListen(options, std::strerror(errno));
  }
  return listener;
}

ConnectionListener::ConnectionListener(const Options& options)
    : table_(options.most, options.most_of_address) {}

ConnectionListener::~ConnectionListener() {
  Stop();
  for (const int fd : {stop_fd_, spare_fd_}) {
    if (fd >= 0) close(fd);
  }
}

absl::Status ConnectionListener::Bind(const Options& options) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE;
  addrinfo* found = nullptr;
  if (const int error = getaddrinfo(options.host.c_str(), nullptr, &hints, &found); error != 0) {
    return CannotListen(options, gai_strerror(error));
  }
  const std::unique_ptr<addrinfo, decltype(&freeaddrinfo)> addresses(found, &freeaddrinfo);
  port_ = options.port;
  int error = EADDRNOTAVAIL;
  // A name may stand for several addresses ("localhost" for two): all of them, on one port.
  for (addrinfo* address = addresses.get(); address != nullptr; address = address->ai_next) {
    const int fd = socket(address->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd < 0) continue;
    const int yes = 1;
    // A port whose last server's connections still end is free; one that is listened on is not.
    setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
    if (address->ai_family == AF_INET6) {
      setsockopt(fd, IPPROTO_IPV6, IPV6_V6ONLY, &yes, sizeof(yes));
    }
    SetPort(port_, address->ai_addr);
    if (bind(fd, address->ai_addr, address->ai_addrlen) == 0 && listen(fd, kBacklog) == 0) {
      listener_fds_.push_back(fd);
      port_ = PortOf(fd);
      continue;
    }
    error = errno;
    close(fd);
    if (error == EADDRINUSE) break;  // listening on some of a name's addresses would confuse users
  }
  if (listener_fds_.empty() || error == EADDRINUSE) {
    return CannotListen(options, std::strerror(error));
  }
  return absl::OkStatus();
}

void ConnectionListener::Start(Handle handle) {
  handle_ = std::move(handle);
  thread_ = std::thread([this] { AcceptUntilStopped(); });
}

void ConnectionListener::Stop() {
  if (thread_.joinable()) {
    const uint64_t one = 1;
    static_cast<void>(write(stop_fd_, &one, sizeof(one)) + 0);
    thread_.join();
  }
  for (const int fd : listener_fds_) close(fd);
  listener_fds_.clear();
}

void ConnectionListener::AcceptUntilStopped() {
  std::vector<pollfd> polled;
  for (const int fd : listener_fds_) polled.push_back({fd, POLLIN, 0});
  polled.push_back({stop_fd_, POLLIN, 0});
  while (true) {
    poll(polled.data(), polled.size(), refused_ > 0 ? kLogMilliseconds : -1);
    if (polled.back().revents != 0) return;
    bool any = false;
    for (size_t i = 0; i + 1 < polled.size(); ++i) {
      if (polled[i].revents == 0) continue;
      any = true;
      while (AcceptOne(polled[i].fd)) {
      }
    }
    if (!any) LogRefusals();
  }
}

bool ConnectionListener::AcceptOne(int listener_fd) {
  sockaddr_storage address{};
  socklen_t size = sizeof(address);
  const int fd = accept4(listener_fd, reinterpret_cast<sockaddr*>(&address), &size,
                         SOCK_NONBLOCK | SOCK_CLOEXEC);
  if (fd < 0) {
    // accept4 reports these even when no connection waits.
    if (errno == EMFILE || errno == ENFILE) return TurnOneAway(listener_fd);
    // Gone before it was accepted, or a signal: there may be more. No memory: later.
    if (errno == ENOBUFS || errno == ENOMEM) poll(nullptr, 0, kPauseMilliseconds);
    return errno == ECONNABORTED || errno == EINTR;
  }
  if (table_.Take(fd, AddressText(address)) != ConnectionTable::Verdict::kTaken) {
    close(fd);
    ++refused_;
    return true;
  }
  // gRPC sets this on connections that it accepts itself. Without it small frames wait until the
  // client has something to say (Nagle's algorithm and delayed acknowledgements): 33 ms in a drag.
  const int yes = 1;
  setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof(yes));
  handle_(fd, listener_fd);
  return true;
}

bool ConnectionListener::TurnOneAway(int listener_fd) {
  if (spare_fd_ >= 0) close(spare_fd_);
  const int fd = accept4(listener_fd, nullptr, nullptr, SOCK_CLOEXEC);
  if (fd >= 0) {
    close(fd);
    ++refused_;
  }
  spare_fd_ = OpenSpare();
  // Another thread has taken the descriptor: wait until one is free, otherwise this would spin.
  if (spare_fd_ < 0) poll(nullptr, 0, kPauseMilliseconds);
  return fd >= 0;
}

void ConnectionListener::LogRefusals() {
  if (refused_ == 0) return;
  spdlog::warn("refused {} connections; {} are open, the limit in all or per address", refused_,
               table_.size());
  refused_ = 0;
}

}  // namespace tissueform
