// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/postgres_connection.h"

#include <atomic>
#include <fcntl.h>
#include <optional>
#include <unistd.h>
#include <utility>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include <pqxx/pqxx>
#include <sys/socket.h>

#include "server/store/postgres_store/postgres_errors.h"
#include "server/store/postgres_store/postgres_rows.h"
#include "server/store/store_errors.h"

namespace tissueform {
namespace {

using Ticks = std::chrono::steady_clock::rep;

// While it lives a call waits for the database.
class WaitForAnswer {
 public:
  explicit WaitForAnswer(std::atomic<Ticks>* since) : since_(since) {
    *since_ = std::chrono::steady_clock::now().time_since_epoch().count();
  }
  ~WaitForAnswer() { *since_ = 0; }
  WaitForAnswer(const WaitForAnswer&) = delete;
  WaitForAnswer& operator=(const WaitForAnswer&) = delete;

 private:
  std::atomic<Ticks>* const since_;
};

class LibraryTransaction final : public PostgresTransaction {
 public:
  LibraryTransaction(const std::string& name, pqxx::work* work, std::atomic<Ticks>* waits_since)
      : name_(name), work_(work), waits_since_(waits_since) {}

  absl::StatusOr<SqlRows> Query(const char* sql, absl::Span<const SqlValue> values) override {
    const std::vector<pqxx::binarystring> parameters = ToParameters(values);
    const WaitForAnswer wait(waits_since_);
    try {
      return ToRows(work_->exec_params(sql, pqxx::prepare::make_dynamic_params(parameters)));
    } catch (...) {
      return Fail();
    }
  }

  absl::Status Execute(const std::string& sql) override {
    const WaitForAnswer wait(waits_since_);
    try {
      work_->exec(sql);
      return absl::OkStatus();
    } catch (...) {
      return Fail();
    }
  }

  const PostgresFailure& failure() const { return failure_; }

 private:
  // REQUIRES: something is being caught.
  absl::Status Fail() {
    if (failure_.status.ok()) failure_ = FailureOfCaught(name_);
    return failure_.status;
  }

  const std::string& name_;
  pqxx::work* const work_;
  std::atomic<Ticks>* const waits_since_;
  PostgresFailure failure_;
};

class NoticeReceiver final : public pqxx::notification_receiver {
 public:
  NoticeReceiver(pqxx::connection_base& connection, const std::string& channel,
                 std::vector<std::string>* notices)
      : notification_receiver(connection, channel), notices_(notices) {}

  void operator()(const std::string& payload, int) override { notices_->push_back(payload); }

 private:
  std::vector<std::string>* const notices_;
};

// libpqxx prints errors that have no handler.
class QuietHandler final : public pqxx::errorhandler {
 public:
  explicit QuietHandler(pqxx::connection_base& connection) : errorhandler(connection) {}
  bool operator()(const char[]) noexcept override { return false; }
};

}  // namespace

struct PostgresConnection::Library {
  explicit Library(const PostgresTarget& target)
      : name(target.name), connection(target.connection), quiet(connection) {
    // One that is lost is replaced as a whole, by the pool.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wdeprecated-declarations"
    connection.inhibit_reactivation(true);
#pragma GCC diagnostic pop
    socket = fcntl(connection.sock(), F_DUPFD_CLOEXEC, 0);
  }
  ~Library() {
    // A receiver says good-bye and waits for the answer, which may never come.
    if (receiver != nullptr) shutdown(socket, SHUT_RDWR);
    if (socket >= 0) close(socket);
  }
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;

  const std::string name;
  pqxx::connection connection;
  QuietHandler quiet;
  // A descriptor of ours of its socket, so that its number is never another file's.
  int socket = -1;
  std::atomic<Ticks> waits_since = 0;  // 0: no call waits
  std::vector<std::string> notices;
  std::unique_ptr<NoticeReceiver> receiver;  // before the connection's end
};

PostgresConnection::PostgresConnection(std::unique_ptr<Library> library)
    : library_(std::move(library)) {}
PostgresConnection::~PostgresConnection() = default;

absl::StatusOr<std::unique_ptr<PostgresConnection>> PostgresConnection::Open(
    const PostgresTarget& target) {
  try {
    return std::unique_ptr<PostgresConnection>(
        new PostgresConnection(std::make_unique<Library>(target)));
  } catch (const std::exception& error) {
    return ConnectError(target.name, error.what());
  }
}

absl::Status PostgresConnection::Transact(
    const std::function<absl::Status(PostgresTransaction&)>& work, PostgresOutcome* outcome) {
  const auto fail = [&](const PostgresFailure& failure) {
    usable_ = failure.connected;
    *outcome = failure.transient ? PostgresOutcome::kTransient : PostgresOutcome::kFailed;
    return failure.status;
  };
  try {
    std::optional<pqxx::work> begun;
    // What is not committed is taken back when it ends, by a statement like others.
    const absl::Cleanup take_back = [&] {
      const WaitForAnswer wait(&library_->waits_since);
      begun.reset();
      usable_ = usable_ && library_->connection.is_open();
    };
    {
      const WaitForAnswer wait(&library_->waits_since);
      begun.emplace(library_->connection);
    }
    LibraryTransaction transaction(library_->name, &*begun, &library_->waits_since);
    const absl::Status status = work(transaction);
    if (!transaction.failure().status.ok()) return fail(transaction.failure());
    *outcome = PostgresOutcome::kFailed;
    if (!status.ok()) return status;
    const WaitForAnswer wait(&library_->waits_since);
    begun->commit();
    *outcome = PostgresOutcome::kCommitted;
    return absl::OkStatus();
  } catch (const pqxx::in_doubt_error&) {
    usable_ = false;
    *outcome = PostgresOutcome::kUnknown;
    return HidingDatabase(
        absl::UnavailableError(absl::StrCat(
            "database ", library_->name,
            ": the connection was lost during a commit, which may have succeeded; check before you "
            "try again")),
        "the server lost its database during the commit, which may have succeeded; check before "
        "you "
        "try again");
  } catch (...) {
    return fail(FailureOfCaught(library_->name));
  }
}

void PostgresConnection::GiveUp(std::chrono::milliseconds unanswered) {
  const Ticks since = library_->waits_since;
  if (since == 0) return;
  const std::chrono::steady_clock::time_point begin{std::chrono::steady_clock::duration(since)};
  if (std::chrono::steady_clock::now() - begin >= unanswered) shutdown(library_->socket, SHUT_RDWR);
}

absl::Status PostgresConnection::Listen(const std::string& channel) {
  const WaitForAnswer wait(&library_->waits_since);
  try {
    library_->receiver =
        std::make_unique<NoticeReceiver>(library_->connection, channel, &library_->notices);
    // The library says nothing of one that was lost then.
    if (!library_->connection.is_open()) throw pqxx::broken_connection();
    return absl::OkStatus();
  } catch (...) {
    usable_ = false;
    return FailureOfCaught(library_->name).status;
  }
}

absl::StatusOr<std::vector<std::string>> PostgresConnection::WaitForNotices(
    std::chrono::milliseconds most) {
  try {
    const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(most);
    library_->connection.await_notification(seconds.count(),
                                            std::chrono::microseconds(most - seconds).count());
    return std::exchange(library_->notices, {});
  } catch (...) {
    usable_ = false;
    return FailureOfCaught(library_->name).status;
  }
}

}  // namespace tissueform
