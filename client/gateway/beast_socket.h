// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

// Of http_server.cc alone.

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>

#include "client/gateway/beast_live.h"

namespace tissueform {

// One WebSocket. No permessage-deflate: Beast 1.74's has flaws.
class BeastSocket final : public Socket,
                          public LiveConnection,
                          public std::enable_shared_from_this<BeastSocket> {
 public:
  using Request = boost::beast::http::request<boost::beast::http::string_body>;

  // Counted in context->sockets already.
  BeastSocket(BeastContext* context, boost::beast::tcp_stream stream, Request request)
      : entry_(&context->live),
        context_(context),
        request_(std::move(request)),
        ws_(std::move(stream)),
        watchdog_(ws_.get_executor()) {}
  ~BeastSocket() override { --context_->sockets; }

  // Answers the request; on the strand.
  void Run(const HttpHead& head) {
    namespace websocket = boost::beast::websocket;
    entry_.Set(weak_from_this());
    context_->counters->Add(GatewayEvent::kSocket);
    user_ = context_->handler->OpenSocket(shared_from_this(), head);
    boost::beast::get_lowest_layer(ws_).expires_never();
    ws_.set_option(websocket::stream_base::timeout{context_->limits.start_deadline,
                                                   context_->limits.stall_deadline, true});
    ws_.set_option(websocket::stream_base::decorator([](websocket::response_type& response) {
      response.set(boost::beast::http::field::sec_websocket_protocol, "tissueform.v1");
      response.set(boost::beast::http::field::server, "tissueform");
    }));
    ws_.binary(true);
    ws_.auto_fragment(false);
    ws_.read_message_max(0);  // ReadSome counts: an end shall be sent before the socket closes
    // The call ends with the client's close, whenever it ends the connection then.
    ws_.control_callback([this](websocket::frame_type kind, boost::beast::string_view) {
      if (kind == websocket::frame_type::close && !closing_since_.has_value()) {
        Post([self = shared_from_this()] { self->Leave(); });
      }
    });
    ws_.async_accept(request_, [self = shared_from_this()](Error error) {
      if (error || self->user_ == nullptr) return self->Gone();
      self->opened_ = true;
      self->silent_since_ = Clock::now();
      self->Watch();
      self->user_->OnOpen();
      if (self->context_->draining) self->DrainNow();
    });
  }

  void Post(std::function<void()> job) override {
    boost::asio::post(ws_.get_executor(), std::move(job));
  }

  void Receive() override {
    waiting_since_.reset();
    ReadSome();
  }

  void Send(std::string message) override {
    if (gone_) return;
    out_ = std::move(message);
    sending_since_ = Clock::now();
    ws_.async_write(boost::asio::buffer(out_),
                    [self = shared_from_this()](Error error, size_t /*bytes*/) {
                      self->sending_since_.reset();
                      if (error) return self->Gone();
                      if (self->user_ != nullptr) self->user_->OnSent();
                    });
  }

  void Close(SocketClose code) override {
    if (gone_ || closing_since_.has_value()) return;
    closing_since_ = Clock::now();
    ws_.async_close(boost::beast::websocket::close_reason(static_cast<uint16_t>(code)),
                    [self = shared_from_this()](Error) { self->Gone(); });
  }

  void Drain() override {
    Post([self = shared_from_this()] {
      if (self->opened_) self->DrainNow();
    });
  }
  void Abort() override {
    Post([self = shared_from_this()] { self->Gone(); });
  }

 private:
  using Error = boost::beast::error_code;
  using Clock = std::chrono::steady_clock;
  using Since = std::optional<Clock::time_point>;

  // Read at once, at most.
  static constexpr size_t kPieceBytes = size_t{256} << 10;
  static constexpr std::chrono::seconds kWatchInterval{1};

  void ReadSome() {
    if (gone_) return;
    ws_.async_read_some(
        in_, kPieceBytes,
        [self = shared_from_this()](Error error, size_t /*bytes*/) { self->OnRead(error); });
  }

  void OnRead(Error error) {
    if (gone_) return;
    if (error) {
      // Beast has sent 1002 then.
      if (error == boost::beast::websocket::condition::protocol_violation) {
        context_->counters->Add(GatewayEvent::kMalformedFrame);
      } else if (error == boost::beast::error::timeout && !closing_since_.has_value()) {
        context_->counters->Add(GatewayEvent::kStalled);  // it answered no ping
      }
      return Gone();
    }
    if (closing_since_.has_value() || user_ == nullptr) return;
    if (!ws_.got_binary()) return Refuse(SocketClose::kText);
    if (in_.size() > context_->limits.message_bytes + kFrameHeadBytes) {
      return Refuse(SocketClose::kTooLarge);
    }
    if (!ws_.is_message_done()) {
      if (!incomplete_since_.has_value()) incomplete_since_ = Clock::now();
      return ReadSome();
    }
    silent_since_.reset();
    incomplete_since_.reset();
    waiting_since_ = Clock::now();
    std::string message = boost::beast::buffers_to_string(in_.data());
    in_.consume(in_.size());
    if (in_.capacity() > kPieceBytes) in_.shrink_to_fit();
    user_->OnMessage(std::move(message));
  }

  void Refuse(SocketClose why) {
    incomplete_since_.reset();
    in_.consume(in_.size());
    user_->OnBadMessage(why);
  }

  // Once a second: whether one of the waits has taken too long.
  void Watch() {
    watchdog_.expires_after(kWatchInterval);
    watchdog_.async_wait([weak = weak_from_this()](Error error) {
      const auto self = weak.lock();
      if (self == nullptr || error || self->gone_) return;
      if (self->IsSilent()) self->user_->OnSilence();
      if (self->user_ != nullptr) self->user_->OnSecond();
      if (!self->Stalls()) return self->Watch();
      self->context_->counters->Add(GatewayEvent::kStalled);
      self->Gone();
    });
  }

  // Says so once.
  bool IsSilent() {
    const bool silent = silent_since_.has_value() &&
                        Clock::now() - *silent_since_ > context_->limits.start_deadline &&
                        user_ != nullptr;
    if (silent) silent_since_.reset();
    return silent;
  }

  bool Stalls() const {
    const auto longer = [now = Clock::now()](const Since& since, std::chrono::seconds time) {
      return since.has_value() && now - *since > time;
    };
    const GatewayLimits& limits = context_->limits;
    return longer(sending_since_, TimeToSend(limits, out_.size())) ||
           longer(waiting_since_, limits.stall_deadline) ||
           longer(incomplete_since_, limits.body_deadline) ||
           longer(closing_since_, limits.drain_deadline);
  }

  void DrainNow() {
    if (user_ != nullptr && !gone_) user_->OnDrain();
  }

  void Gone() {
    if (gone_) return;
    gone_ = true;
    watchdog_.cancel();
    boost::beast::get_lowest_layer(ws_).close();
    Leave();
  }

  void Leave() {
    if (const auto user = std::move(user_); user != nullptr) user->OnGone();
  }

  // Of docs/gateway.md; longer heads than that are the gateway's own.
  static constexpr size_t kFrameHeadBytes = 32;

  LiveEntry entry_;
  BeastContext* const context_;
  const Request request_;
  boost::beast::websocket::stream<boost::beast::tcp_stream, false> ws_;
  boost::asio::steady_timer watchdog_;
  std::shared_ptr<SocketUser> user_;
  boost::beast::flat_buffer in_;
  std::string out_;
  bool opened_ = false;
  bool gone_ = false;
  Since silent_since_;
  Since sending_since_;
  Since waiting_since_;  // no message is requested
  Since incomplete_since_;
  Since closing_since_;
};

}  // namespace tissueform
