// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>

#include "absl/strings/string_view.h"

#include "client/gateway/access_rules.h"
#include "client/gateway/forwarded_addresses.h"
#include "client/gateway/gateway_counters.h"
#include "client/gateway/http_server.h"
#include "client/gateway/login_config.h"
#include "client/gateway/upstream_pool.h"
#include "client/gateway/web_files.h"

namespace tissueform {

// What is done with each request (docs/gateway.md): who may ask, which path is what.
class GatewayRoutes final : public HttpHandler {
 public:
  // `page_config` is what /config.json answers. `pool` and `counters` must outlive it.
  GatewayRoutes(AccessRules rules, ForwardedAddresses addresses, WebFiles files,
                const LoginConfig& login, std::string page_config, UpstreamPool* pool,
                GatewayCounters* counters);

  HttpDecision Decide(const HttpHead& head) override;
  std::shared_ptr<ReplySource> Stream(const HttpHead& head, std::string body,
                                      std::shared_ptr<ReplyStream> reply) override;
  std::shared_ptr<SocketUser> OpenSocket(std::shared_ptr<Socket> socket,
                                         const HttpHead& head) override;
  HttpReply ReplyWith(int status) override;

 private:
  HttpDecision Refuse(GatewayEvent event, int status);
  HttpDecision DecideSocket(const HttpHead& head);
  HttpDecision DecideCall(const HttpHead& head);
  HttpDecision DecideConfig(const HttpHead& head);
  HttpDecision DecideFile(const HttpHead& head);
  // What a browser asks before a page of another origin may make a call.
  HttpDecision Preflight(const HttpHead& head);
  // For pages of other origins that are allowed.
  HttpFields OriginFields(const HttpHead& head) const;
  // Of every answer.
  HttpFields CommonFields() const;

  // Constant.
  const AccessRules rules_;
  const ForwardedAddresses addresses_;
  const WebFiles files_;
  const std::shared_ptr<const std::string> page_config_;
  const std::string security_policy_;

  // Self-synchronised.
  UpstreamPool* const pool_;
  GatewayCounters* const counters_;
};

}  // namespace tissueform
