// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/review/review_server.h"

#include <filesystem>
#include <fstream>
#include <httplib.h>
#include <set>
#include <sstream>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"

#include "client/pacs_bridge/queue/export_rows.h"
#include "client/pacs_bridge/review/review_access.h"
#include "client/pacs_bridge/review/review_page.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr size_t kMaxRequestBytes = 16 << 10;
constexpr size_t kServingThreads = 4;
constexpr int kIdleSeconds = 10;
constexpr uintmax_t kMaxPictureBytes = 16 << 20;

constexpr char kHtml[] = "text/html; charset=utf-8";
constexpr char kText[] = "text/plain; charset=utf-8";

class HttpReviewServer final : public ReviewServer {
 public:
  HttpReviewServer(ReviewOptions options, std::string password, BridgeQueue* queue,
                   std::function<void()> confirmed)
      : options_(std::move(options)),
        password_(std::move(password)),
        form_token_(NewQueueKey()),
        queue_(queue),
        confirmed_(std::move(confirmed)) {
    hosts_ = {"127.0.0.1", "localhost", "[::1]"};
    hosts_.insert(options_.allowed_hosts.begin(), options_.allowed_hosts.end());
    if (!IsLoopbackAddress(options_.address)) hosts_.insert(options_.address);
    SetLimits();
    SetRoutes();
  }

  ~HttpReviewServer() override {
    server_.stop();
    if (thread_.joinable()) thread_.join();
  }

  absl::Status Listen() {
    // Not SO_REUSEPORT, httplib's default: a second server would share the port in silence.
    server_.set_socket_options([](socket_t socket) {
      const int yes = 1;
      setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
    });
    if (options_.port == 0) {
      port_ = server_.bind_to_any_port(options_.address);
    } else if (server_.bind_to_port(options_.address, options_.port)) {
      port_ = options_.port;
    }
    if (port_ <= 0) {
      return absl::UnavailableError(absl::StrCat("the review page cannot listen on ",
                                                 options_.address, ":", options_.port,
                                                 "; name another --review-listen"));
    }
    thread_ = std::thread([this] { server_.listen_after_bind(); });
    // What is stopped before it runs would never end (httplib 0.11).
    while (!server_.is_running()) std::this_thread::yield();
    return absl::OkStatus();
  }

  int port() const override { return port_; }

 private:
  using Request = httplib::Request;
  using Response = httplib::Response;

  void SetLimits() {
    server_.new_task_queue = [] { return new httplib::ThreadPool(kServingThreads); };
    server_.set_payload_max_length(kMaxRequestBytes);
    server_.set_read_timeout(kIdleSeconds);
    server_.set_write_timeout(kIdleSeconds);
    server_.set_keep_alive_timeout(kIdleSeconds);
    server_.set_default_headers(
        {{"Cache-Control", "no-store"},
         {"Content-Security-Policy",
          "default-src 'none'; style-src 'self'; img-src 'self'; form-action 'self'; "
          "base-uri 'none'; frame-ancestors 'none'"},
         {"X-Content-Type-Options", "nosniff"},
         {"Referrer-Policy", "same-origin"},
         {"Cross-Origin-Resource-Policy", "same-origin"}});
    server_.set_exception_handler(
        [](const Request&, Response& response, const std::exception_ptr&) {
          Refuse(&response, 500, "invalid request");
        });
  }

  void SetRoutes() {
    server_.set_pre_routing_handler([this](const Request& request, Response& response) {
      return MayCome(request, &response) ? httplib::Server::HandlerResponse::Unhandled
                                         : httplib::Server::HandlerResponse::Handled;
    });
    server_.Get("/", [this](const Request& request, Response& response) {
      const bool confirmed = request.has_param("confirmed");
      Show(confirmed ? "Confirmed. It is being stored." : "", false, &response);
    });
    server_.Get("/style.css", [](const Request&, Response& response) {
      response.set_content(std::string(ReviewStyle()), "text/css; charset=utf-8");
    });
    server_.Get(R"(/pictures/([0-9a-f]{32})/([a-z0-9_-]{1,64}\.png))",
                [this](const Request& request, Response& response) {
                  SendPicture(request.matches[1], request.matches[2], &response);
                });
    server_.Post("/store", [this](const Request& request, Response& response) {
      Confirm(request, &response);
    });
  }

  static void Refuse(Response* response, int status, const char* why) {
    response->status = status;
    response->set_content(absl::StrCat(why, "\n"), kText);
  }

  bool MayCome(const Request& request, Response* response) const {
    if (!hosts_.contains(HostWithoutPort(request.get_header_value("Host")))) {
      Refuse(response, 421, "unknown host; see --review-host");
      return false;
    }
    if (password_.empty()) return true;
    const std::string given = request.get_header_value("Authorization");
    const bool is_accepted = IsBasicPassword(given, password_);
    // Browsers ask once without a password before they ask the user: that is not a login.
    if (!given.empty() && options_.on_login) {
      const absl::Status heard = options_.on_login(
          {.address = request.remote_addr, .user = BasicName(given), .is_accepted = is_accepted});
      if (is_accepted && !heard.ok()) {
        Refuse(response, 503, "the login cannot be recorded; see the log of the bridge");
        return false;
      }
    }
    if (is_accepted) return true;
    response->set_header("WWW-Authenticate", "Basic realm=\"Tissueform review page\"");
    Refuse(response, 401, "the review page requires its password");
    return false;
  }

  // Of a browser that says where a form comes from: from here.
  static bool IsFromHere(const Request& request) {
    const std::string origin = request.get_header_value("Origin");
    const std::string host = request.get_header_value("Host");
    return origin.empty() || origin == absl::StrCat("http://", host) ||
           origin == absl::StrCat("https://", host);
  }

  void Show(const std::string& notice, bool is_problem, Response* response) {
    const absl::StatusOr<ReviewQueue> list = ReadReviewQueue(queue_);
    if (!list.ok()) return Refuse(response, 503, "the queue cannot be read; see the log");
    response->set_content(ReviewPage(*list, {.planner_url = options_.planner_url,
                                             .form_token = form_token_,
                                             .notice = notice,
                                             .notice_is_problem = is_problem}),
                          kHtml);
  }

  void Confirm(const Request& request, Response* response) {
    if (!IsFromHere(request) || !IsSameSecret(request.get_param_value("token"), form_token_)) {
      return Refuse(response, 403,
                    "this form is not from the review page, or the bridge was "
                    "restarted; reload the page");
    }
    const std::string shown = request.get_param_value("patient");
    const absl::Status status = ConfirmAsShown(request.get_param_value("export"), shown);
    if (!status.ok()) {
      response->status = 409;
      return Show(
          "Not stored: this prediction is no longer waiting, or its patient's data "
          "changed after the page was loaded. Check again.",
          true, response);
    }
    if (confirmed_) confirmed_();
    response->set_redirect("/?confirmed=1", 303);
  }

  absl::Status ConfirmAsShown(const std::string& name, const std::string& shown) {
    ReceivedRows received(queue_);
    ExportRows exports(queue_);
    TF_ASSIGN_OR_RETURN(const QueuedExport queued, exports.Get(name));
    TF_ASSIGN_OR_RETURN(const QueuedSeries series, received.GetByCase(queued.case_name));
    TF_ASSIGN_OR_RETURN(const QueuedStudy study, received.GetStudy(series.study_uid));
    if (DigestOf(study.patient) != shown) {
      return absl::AbortedError("the patient differs from the one shown");
    }
    return exports.Confirm(name, shown);
  }

  void SendPicture(const std::string& export_key, const std::string& name,
                   Response* response) const {
    const std::string path = absl::StrCat(queue_->object_folder(export_key), "/pictures/", name);
    std::error_code error;
    const uintmax_t size = std::filesystem::file_size(path, error);
    if (error || size > kMaxPictureBytes) return Refuse(response, 404, "there is no such picture");
    std::ifstream file(path, std::ios::binary);
    std::ostringstream bytes;
    bytes << file.rdbuf();
    response->set_content(std::move(bytes).str(), "image/png");
  }

  // Constant.
  const ReviewOptions options_;
  const std::string password_;    // empty: none
  const std::string form_token_;  // of this process
  BridgeQueue* const queue_;
  const std::function<void()> confirmed_;
  std::set<std::string> hosts_;
  int port_ = 0;

  httplib::Server server_;
  std::thread thread_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<ReviewServer>> ReviewServer::Start(const ReviewOptions& options,
                                                                  BridgeQueue* queue,
                                                                  std::function<void()> confirmed) {
  std::string password;
  if (!options.token_file.empty()) {
    TF_ASSIGN_OR_RETURN(password, ReadReviewPassword(options.token_file));
  } else if (!IsLoopbackAddress(options.address)) {
    return absl::InvalidArgumentError(
        absl::StrCat("the review page shows patient names: at ", options.address,
                     " it needs --review-token-file, or listen on 127.0.0.1"));
  }
  auto server =
      std::make_unique<HttpReviewServer>(options, std::move(password), queue, std::move(confirmed));
  TF_RETURN_IF_ERROR(server->Listen());
  return std::unique_ptr<ReviewServer>(std::move(server));
}

}  // namespace tissueform
