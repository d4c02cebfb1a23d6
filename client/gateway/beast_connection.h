// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

// Of http_server.cc alone.

#include <cerrno>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/ascii.h"
#include <boost/asio/write.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <sys/socket.h>

#include "client/gateway/beast_live.h"
#include "client/gateway/beast_socket.h"

namespace tissueform {

// One connection of HTTP/1.1: a request after the other, until it becomes a WebSocket.
class BeastConnection final : public ReplyStream,
                              public LiveConnection,
                              public std::enable_shared_from_this<BeastConnection> {
 public:
  BeastConnection(BeastContext* context, boost::asio::ip::tcp::socket socket)
      : entry_(&context->live),
        context_(context),
        stream_(std::move(socket)),
        executor_(stream_.get_executor()) {}

  // Any thread.
  void Run() {
    Error gone;
    const auto other_end = stream_.socket().remote_endpoint(gone);
    if (!gone) peer_ = other_end.address().to_string();
    entry_.Set(weak_from_this());
    Post([self = shared_from_this()] {
      self->AwaitRequest(self->context_->limits.header_deadline);
    });
  }

  void Post(std::function<void()> job) override { boost::asio::post(executor_, std::move(job)); }

  void Begin(const HttpReply& head) override { head_ = ToResponse(head); }

  void Send(std::string piece, bool last) override {
    if (!streams_) return;
    wire_.clear();
    // HTTP/1.0 has no chunks: the end of the connection ends the body.
    const bool chunked = Version() >= 11;
    if (head_.has_value()) {
      head_->chunked(chunked);
      head_->keep_alive(chunked && StaysOpen());
      wire_ = HeadText(*head_);
      head_.reset();
    }
    const auto buffer = boost::asio::buffer(piece);
    if (!chunked) {
      wire_ += piece;
    } else if (!piece.empty()) {
      wire_ += boost::beast::buffers_to_string(boost::beast::http::make_chunk(buffer));
    }
    if (chunked && last)
      wire_ += boost::beast::buffers_to_string(boost::beast::http::make_chunk_last());
    stream_.expires_after(TimeToSend(context_->limits, wire_.size()));
    boost::asio::async_write(stream_, boost::asio::buffer(wire_),
                             [self = shared_from_this(), last](Error error, size_t /*bytes*/) {
                               self->OnPieceSent(error, last);
                             });
  }

  void Drain() override {
    Post([self = shared_from_this()] {
      if (self->streams_) {
        self->source_->OnDrain();
      } else if (self->awaits_request_) {
        self->stream_.close();
      }
    });
  }
  void Abort() override {
    Post([self = shared_from_this()] { self->Gone(); });
  }

 private:
  using Error = boost::beast::error_code;
  template <typename Body>
  using Response = boost::beast::http::response<Body>;
  using EmptyResponse = Response<boost::beast::http::empty_body>;
  using FileBody = boost::beast::http::span_body<const char>;
  // Buffers what a client sends before it is asked for.
  static constexpr size_t kPieceBytes = size_t{64} << 10;
  // After a refusal: what a client still sends is read for so long, so that it gets the reply.
  static constexpr std::chrono::seconds kLingerTime{2};
  static constexpr size_t kLingerBytes = size_t{16} << 20;

  void AwaitRequest(std::chrono::seconds deadline) {
    if (context_->draining) return stream_.close();
    if (buffer_.size() > 0) return ReadHead();
    awaits_request_ = true;
    stream_.expires_after(deadline);
    stream_.async_read_some(buffer_.prepare(kPieceBytes),
                            [self = shared_from_this()](Error error, size_t bytes) {
                              self->awaits_request_ = false;
                              if (error) return self->stream_.close();
                              self->buffer_.commit(bytes);
                              self->ReadHead();
                            });
  }

  void ReadHead() {
    parser_.emplace();
    parser_->header_limit(static_cast<uint32_t>(context_->limits.header_bytes));
    parser_->body_limit(context_->limits.message_bytes + kWebFrameHeadBytes);
    stream_.expires_after(context_->limits.header_deadline);
    boost::beast::http::async_read_header(
        stream_, buffer_, *parser_, [self = shared_from_this()](Error error, size_t /*bytes*/) {
          if (error) return self->OnReadError(error);
          self->OnHead();
        });
  }

  void OnReadError(Error error) {
    const auto refuse = [this](GatewayEvent event, int status) {
      context_->counters->Add(event);
      Write(context_->handler->ReplyWith(status), false);
    };
    if (error == boost::beast::http::error::header_limit ||
        error == boost::beast::http::error::buffer_overflow) {
      return refuse(GatewayEvent::kHeaderTooLarge, 431);
    }
    if (error == boost::beast::http::error::body_limit)
      return refuse(GatewayEvent::kBodyTooLarge, 413);
    const bool malformed =
        error.category() == make_error_code(boost::beast::http::error::bad_method).category() &&
        error != boost::beast::http::error::end_of_stream &&
        error != boost::beast::http::error::partial_message;
    if (malformed) return refuse(GatewayEvent::kMalformedRequest, 400);
    context_->counters->Add(error == boost::beast::error::timeout ? GatewayEvent::kTooSlow
                                                                  : GatewayEvent::kClientGone);
    stream_.close();
  }

  void OnHead() {
    request_head_ = ToHead(parser_->get());
    request_head_.peer = peer_;
    context_->counters->Add(GatewayEvent::kRequest);
    const HttpDecision decision = context_->handler->Decide(request_head_);
    switch (decision.kind) {
      case HttpDecision::kReply:
        // A page asks by a plain GET why its socket did not open.
        if (decision.reply.status == 426 && context_->sockets >= context_->limits.sockets) {
          return Write(context_->handler->ReplyWith(503), parser_->is_done());
        }
        return Write(decision.reply, parser_->is_done());
      case HttpDecision::kStream:
        return ReadBody();
      case HttpDecision::kSocket:
        return BecomeSocket();
    }
  }

  void ReadBody() {
    stream_.expires_after(context_->limits.body_deadline);
    boost::beast::http::async_read(
        stream_, buffer_, *parser_, [self = shared_from_this()](Error error, size_t /*bytes*/) {
          if (error) return self->OnReadError(error);
          self->stream_.expires_never();
          self->streams_ = true;
          self->source_ = self->context_->handler->Stream(
              self->request_head_, std::move(self->parser_->get().body()), self);
          self->WatchForEnd(self->stream_count_);
          if (self->context_->draining) self->source_->OnDrain();
        });
  }

  // A client that goes away shows by what could be read.
  void WatchForEnd(int64_t stream_count) {
    stream_.socket().async_wait(boost::asio::socket_base::wait_read,
                                [self = shared_from_this(), stream_count](Error error) {
                                  if (!self->streams_ || stream_count != self->stream_count_)
                                    return;
                                  if (error == boost::asio::error::operation_aborted)
                                    return;  // a piece was not taken
                                  char byte = 0;
                                  const ssize_t size = recv(self->stream_.socket().native_handle(),
                                                            &byte, 1, MSG_PEEK | MSG_DONTWAIT);
                                  if (size > 0) return;  // the next request
                                  if (size < 0 && errno == EAGAIN && !error)
                                    return self->WatchForEnd(stream_count);
                                  self->context_->counters->Add(GatewayEvent::kClientGone);
                                  self->Gone();
                                });
  }

  void OnPieceSent(Error error, bool last) {
    if (!streams_) return;
    if (error) {
      context_->counters->Add(error == boost::beast::error::timeout ? GatewayEvent::kStalled
                                                                    : GatewayEvent::kClientGone);
      return Gone();
    }
    stream_.expires_never();
    if (!last) return source_->OnSent();
    streams_ = false;
    source_.reset();
    ++stream_count_;
    if (Version() < 11 || !StaysOpen()) return Linger();
    AwaitRequest(context_->limits.idle_deadline);
  }

  // The whole reply.
  void Write(const HttpReply& reply, bool stays_open) {
    stays_open = stays_open && StaysOpen();
    const auto body = reply.body != nullptr ? reply.body : std::make_shared<const std::string>();
    auto response = std::make_shared<Response<FileBody>>(ToResponse(reply).base());
    response->body() = boost::beast::span<const char>(body->data(), body->size());
    response->prepare_payload();
    response->keep_alive(stays_open);
    auto serializer =
        std::make_shared<boost::beast::http::response_serializer<FileBody>>(*response);
    stream_.expires_after(TimeToSend(context_->limits, body->size()));
    const auto done = [self = shared_from_this(), response, serializer, body, stays_open](
                          Error error, size_t /*bytes*/) {
      if (error) return self->stream_.close();
      if (!stays_open) return self->Linger();
      self->AwaitRequest(self->context_->limits.idle_deadline);
    };
    if (request_head_.method == "HEAD") {
      boost::beast::http::async_write_header(stream_, *serializer, done);
    } else {
      boost::beast::http::async_write(stream_, *serializer, done);
    }
  }

  void BecomeSocket() {
    if (++context_->sockets > context_->limits.sockets) {
      --context_->sockets;
      context_->counters->Add(GatewayEvent::kTooManySockets);
      return Write(context_->handler->ReplyWith(503), true);
    }
    std::make_shared<BeastSocket>(context_, std::move(stream_), parser_->release())
        ->Run(request_head_);
  }

  // Says that nothing more comes and reads what the client still sends, so that it is not reset
  // before it has read the reply.
  void Linger() {
    Error ignored;
    stream_.socket().shutdown(boost::asio::ip::tcp::socket::shutdown_send, ignored);
    stream_.expires_after(kLingerTime);
    buffer_.consume(buffer_.size());
    Discard(0);
  }
  void Discard(size_t so_far) {
    stream_.async_read_some(buffer_.prepare(kPieceBytes),
                            [self = shared_from_this(), so_far](Error error, size_t bytes) {
                              if (error || so_far + bytes > kLingerBytes) {
                                return self->stream_.close();
                              }
                              self->Discard(so_far + bytes);
                            });
  }

  void Gone() {
    streams_ = false;
    ++stream_count_;
    if (const auto source = std::move(source_); source != nullptr) source->OnGone();
    stream_.close();
  }

  unsigned Version() const { return parser_.has_value() ? parser_->get().version() : 11; }
  bool StaysOpen() const {
    return parser_.has_value() && parser_->get().keep_alive() && !context_->draining;
  }

  EmptyResponse ToResponse(const HttpReply& reply) const {
    EmptyResponse response;
    response.version(Version() < 11 ? 10 : 11);
    response.result(static_cast<unsigned>(reply.status));
    for (const auto& [name, value] : reply.fields) response.insert(name, value);
    return response;
  }

  static std::string HeadText(EmptyResponse& response) {
    boost::beast::http::response_serializer<boost::beast::http::empty_body> serializer(response);
    serializer.split(true);
    std::string text;
    Error error;
    serializer.next(error, [&](Error&, const auto& buffers) {
      text = boost::beast::buffers_to_string(buffers);
      serializer.consume(text.size());
    });
    return text;
  }

  static HttpHead ToHead(const BeastSocket::Request& request) {
    HttpHead head = {.method = std::string(request.method_string()),
                     .target = std::string(request.target()),
                     .wants_socket = boost::beast::websocket::is_upgrade(request)};
    for (const auto& field : request) {
      head.fields.emplace_back(absl::AsciiStrToLower(std::string(field.name_string())),
                               std::string(field.value()));
    }
    return head;
  }

  // Of a gRPC-Web frame.
  static constexpr size_t kWebFrameHeadBytes = 5;

  LiveEntry entry_;
  BeastContext* const context_;
  boost::beast::tcp_stream stream_;
  const boost::beast::tcp_stream::executor_type executor_;
  boost::beast::flat_buffer buffer_;
  std::optional<boost::beast::http::request_parser<boost::beast::http::string_body>> parser_;
  std::string peer_;  // see HttpHead
  HttpHead request_head_;
  bool awaits_request_ = false;
  // Of a reply in pieces.
  bool streams_ = false;
  std::shared_ptr<ReplySource> source_;
  std::optional<EmptyResponse> head_;
  std::string wire_;
  int64_t stream_count_ = 0;
};

}  // namespace tissueform
