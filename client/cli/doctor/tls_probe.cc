// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/doctor/tls_probe.h"

#include <algorithm>
#include <array>
#include <ctime>
#include <memory>
#include <poll.h>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>

#include "core/base/certificates.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

using SteadyClock = std::chrono::steady_clock;

// With fewer days left, the server's operator gets a warning.
constexpr int kFewDays = 14;
// As ALPN names them.
constexpr char kHttp2[] = "h2";
constexpr char kHttp1[] = "http/1.1";
// After the handshake: for the server's settings, or its word that it wants a certificate.
constexpr std::chrono::seconds kFirstWords{2};

using Context = std::unique_ptr<SSL_CTX, decltype(&SSL_CTX_free)>;
using Session = std::unique_ptr<SSL, decltype(&SSL_free)>;

DoctorLine Failed(const std::string& text, const std::string& advice) {
  return {.check = "encryption", .finding = Finding::kFailed, .text = text, .advice = advice};
}

std::string LastError() {
  const uint64_t code = ERR_peek_last_error();
  const char* const reason = ERR_reason_error_string(code);
  ERR_clear_error();
  return reason == nullptr ? "the connection was closed" : reason;
}

// How often an operation is to be repeated says OpenSSL. True: it succeeded.
template <typename Operation>
bool Repeat(const ProbeSocket& socket, SSL* ssl, SteadyClock::time_point deadline,
            const Operation& operation) {
  while (true) {
    const int result = operation();
    if (result > 0) return true;
    const int error = SSL_get_error(ssl, result);
    if (error != SSL_ERROR_WANT_READ && error != SSL_ERROR_WANT_WRITE) return false;
    if (!socket.Wait(error == SSL_ERROR_WANT_READ ? POLLIN : POLLOUT, deadline)) return false;
  }
}

absl::StatusOr<Context> MakeContext(const ConnectionOptions& options) {
  Context context(SSL_CTX_new(TLS_client_method()), SSL_CTX_free);
  SSL_CTX_set_min_proto_version(context.get(), TLS1_2_VERSION);
  const bool roots = options.tls_ca.empty()
                         ? SSL_CTX_set_default_verify_paths(context.get()) == 1
                         : SSL_CTX_load_verify_file(context.get(), options.tls_ca.c_str()) == 1;
  if (!roots) return absl::InvalidArgumentError(absl::StrCat(options.tls_ca, ": ", LastError()));
  if (options.tls_certificate.empty()) return context;
  const bool own =
      SSL_CTX_use_certificate_chain_file(context.get(), options.tls_certificate.c_str()) == 1 &&
      SSL_CTX_use_PrivateKey_file(context.get(), options.tls_key.c_str(), SSL_FILETYPE_PEM) == 1;
  if (!own) {
    return absl::InvalidArgumentError(absl::StrCat(options.tls_certificate, ": ", LastError()));
  }
  return context;
}

// Offers one protocol by ALPN, as gRPC does: a server that has several picks by its own order.
Session MakeSession(SSL_CTX* context, const ProbeSocket& socket, const std::string& host,
                    const std::string& protocol) {
  const std::string offer =
      absl::StrCat(std::string(1, static_cast<char>(protocol.size())), protocol);
  Session session(SSL_new(context), SSL_free);
  SSL_set_fd(session.get(), socket.fd());
  SSL_set_alpn_protos(session.get(), reinterpret_cast<const unsigned char*>(offer.data()),
                      static_cast<unsigned int>(offer.size()));
  X509_VERIFY_PARAM* const wanted = SSL_get0_param(session.get());
  // An address is one when OpenSSL takes it for one.
  if (X509_VERIFY_PARAM_set1_ip_asc(wanted, host.c_str()) != 1) {
    ERR_clear_error();
    SSL_set_tlsext_host_name(session.get(), host.c_str());
    X509_VERIFY_PARAM_set1_host(wanted, host.c_str(), host.size());
  }
  return session;
}

// Of the certificate of the chain that ends first.
int DaysLeft(SSL* ssl) {
  int least = 1'000'000;
  const STACK_OF(X509)* chain = SSL_get_peer_cert_chain(ssl);
  for (int i = 0; i < sk_X509_num(chain); ++i) {
    int days = 0;
    int seconds = 0;
    ASN1_TIME_diff(&days, &seconds, nullptr, X509_get0_notAfter(sk_X509_value(chain, i)));
    least = std::min(least, days);
  }
  return least;
}

// What `print` writes of the server's certificate; empty if it has sent no certificate.
template <typename Print>
std::string TextOfCertificate(SSL* ssl, const Print& print) {
  const std::unique_ptr<X509, decltype(&X509_free)> leaf(SSL_get1_peer_certificate(ssl), X509_free);
  const std::unique_ptr<BIO, decltype(&BIO_free)> text(BIO_new(BIO_s_mem()), BIO_free);
  if (leaf == nullptr || print(text.get(), leaf.get()) < 0) return {};
  char* data = nullptr;
  const auto size = static_cast<size_t>(BIO_get_mem_data(text.get(), &data));
  return {data, size};
}

std::string NamesOf(SSL* ssl) {
  const auto facts = ReadCertificate(TextOfCertificate(
      ssl, [](BIO* text, X509* leaf) { return PEM_write_bio_X509(text, leaf) == 1 ? 1 : -1; }));
  return facts.ok() ? absl::StrJoin(facts->names, ", ") : std::string();
}

// ", issued by CN=...": where a box on the way inspects TLS, its authority stands here. Bounded:
// the name is the peer's.
std::string IssuerOf(SSL* ssl) {
  constexpr size_t kMaxBytes = 160;
  const std::string issuer = TextOfCertificate(ssl, [](BIO* text, X509* leaf) {
    return X509_NAME_print_ex(text, X509_get_issuer_name(leaf), 0, XN_FLAG_RFC2253);
  });
  return issuer.empty() ? "" : absl::StrCat(", issued by ", issuer.substr(0, kMaxBytes));
}

// What the peer picked of the protocol that was offered; empty: nothing.
std::string ChosenProtocol(SSL* ssl) {
  const unsigned char* data = nullptr;
  unsigned int size = 0;
  SSL_get0_alpn_selected(ssl, &data, &size);
  return {reinterpret_cast<const char*>(data), size};
}

// Whether the peer speaks HTTP/1.1 and not HTTP/2, asked after it has not picked the latter.
bool PicksHttp1(SSL_CTX* context, const ServerEndpoint& endpoint) {
  const absl::StatusOr<ProbeSocket> socket = ConnectProbe(endpoint);
  if (!socket.ok()) return false;
  const Session session = MakeSession(context, *socket, endpoint.host, kHttp1);
  const bool shook = Repeat(*socket, session.get(), SteadyClock::now() + kProbeDeadline,
                            [&] { return SSL_connect(session.get()); });
  ERR_clear_error();
  return shook && ChosenProtocol(session.get()) == kHttp1;
}

DoctorLine WithoutHttp2(SSL_CTX* context, const ServerEndpoint& endpoint, const std::string& what) {
  return Failed(
      absl::StrCat(
          what, "ALPN did not select HTTP/2 (h2), which gRPC needs; the peer ",
          PicksHttp1(context, endpoint) ? "selects http/1.1" : "does not select a protocol"),
      "a proxy terminates TLS: let it offer h2 by ALPN (HAProxy: alpn h2; nginx: http2 and "
      "grpc_pass), or pass TCP through to the server");
}

DoctorLine BadCertificate(SSL* ssl, int64_t why, const ServerEndpoint& endpoint) {
  const std::string text = absl::StrCat("the server's certificate", IssuerOf(ssl), ": ",
                                        X509_verify_cert_error_string(why));
  switch (why) {
    case X509_V_ERR_CERT_HAS_EXPIRED:
      return Failed(absl::StrCat(text, ", ", -DaysLeft(ssl), " days ago"),
                    "the server's operator must renew it (--tls-cert); or is this machine's clock "
                    "wrong?");
    case X509_V_ERR_CERT_NOT_YET_VALID:
      return Failed(text, "is this machine's clock wrong?");
    case X509_V_ERR_HOSTNAME_MISMATCH:
    case X509_V_ERR_IP_ADDRESS_MISMATCH:
      return Failed(
          absl::StrCat("the server's certificate is for ", NamesOf(ssl), " and not for ",
                       endpoint.host, IssuerOf(ssl)),
          "connect using a name in the certificate, or issue a certificate for this name");
    case X509_V_ERR_DEPTH_ZERO_SELF_SIGNED_CERT:
    case X509_V_ERR_SELF_SIGNED_CERT_IN_CHAIN:
    case X509_V_ERR_UNABLE_TO_GET_ISSUER_CERT:
    case X509_V_ERR_UNABLE_TO_GET_ISSUER_CERT_LOCALLY:
    case X509_V_ERR_UNABLE_TO_VERIFY_LEAF_SIGNATURE:
      return Failed(
          text,
          "pass the certificate of the authority that issued it: --tls-ca FILE; if you do "
          "not know the issuer, do not continue");
    default:
      return Failed(text, "issue a new certificate");
  }
}

DoctorLine Refused(const std::string& why, const ConnectionOptions& options) {
  if (absl::StrContains(why, "wrong version number") || absl::StrContains(why, "packet length")) {
    return Failed("the port does not speak TLS",
                  "omit --tls and --tls-ca if the server is on this machine, or use its "
                  "encrypted port");
  }
  return Failed(
      absl::StrCat("no handshake: ", why),
      options.tls_certificate.empty()
          ? "the server may require a client certificate: --tls-cert and --tls-key"
          : "the server rejects this client certificate: has it expired, or is it from an "
            "authority other than its --tls-client-ca?");
}

}  // namespace

DoctorLine CheckTls(const ServerEndpoint& endpoint, const ConnectionOptions& options) {
  const absl::StatusOr<Context> context = MakeContext(options);
  if (!context.ok()) return Failed(std::string(context.status().message()), "give another file");
  const absl::StatusOr<ProbeSocket> socket = ConnectProbe(endpoint);
  if (!socket.ok()) return Failed(std::string(socket.status().message()), "");
  const Session session = MakeSession(context->get(), *socket, endpoint.host, kHttp2);
  SSL* const ssl = session.get();
  ERR_clear_error();
  if (!Repeat(*socket, ssl, SteadyClock::now() + kProbeDeadline,
              [&] { return SSL_connect(ssl); })) {
    const int64_t why = SSL_get_verify_result(ssl);
    if (why != X509_V_OK) return BadCertificate(ssl, why, endpoint);
    const std::string error = LastError();
    return absl::StrContains(error, "no application protocol")
               ? WithoutHttp2(context->get(), endpoint, "")
               : Refused(error, options);
  }
  if (const int64_t why = SSL_get_verify_result(ssl); why != X509_V_OK) {
    return BadCertificate(ssl, why, endpoint);
  }
  // By TLS 1.3 a server says only now that it wants another certificate.
  std::array<char, 16> settings{};
  const bool spoke = Repeat(*socket, ssl, SteadyClock::now() + kFirstWords,
                            [&] { return SSL_read(ssl, settings.data(), settings.size()); });
  if (!spoke && ERR_peek_last_error() != 0) return Refused(LastError(), options);
  const int days = DaysLeft(ssl);
  const std::string what = absl::StrCat(SSL_get_version(ssl), ", certificate of ", NamesOf(ssl),
                                        ", ", days, " days left", IssuerOf(ssl));
  if (ChosenProtocol(ssl) != kHttp2) {
    return WithoutHttp2(context->get(), endpoint, absl::StrCat(what, "; "));
  }
  DoctorLine line = {.check = "encryption", .text = absl::StrCat(what, "; ALPN selected h2")};
  if (days < kFewDays) {
    line.finding = Finding::kWarning;
    line.advice = "the server's operator should renew the certificate (--tls-cert)";
  }
  return line;
}

DoctorLine CheckPlain(const ServerEndpoint& endpoint) {
  const absl::StatusOr<std::string> answer = AnswerToPlainHttp2(endpoint);
  // A frame of settings: three bytes of length, then its type.
  if (answer.ok() && answer->size() > 3 && (*answer)[3] == '\4') {
    return {.check = "encryption", .text = "none: the port speaks HTTP/2 in plain text"};
  }
  if (answer.ok() && absl::StartsWith(*answer, "HTTP/1.")) {
    return Failed("the port speaks HTTP/1.1 in plain text, and gRPC needs HTTP/2",
                  "is it the port of a gateway or a proxy? The server uses another port");
  }
  const DoctorLine encrypted = CheckTls(endpoint, {.tls = true});
  if (encrypted.finding != Finding::kFailed || absl::StrContains(encrypted.text, "certificate") ||
      absl::StrContains(encrypted.text, "ALPN")) {
    return Failed("the port speaks TLS, and this client does not",
                  "pass --tls-ca FILE with the authority of the server's certificate, or --tls");
  }
  return Failed("the port speaks neither HTTP/2 nor TLS",
                "is it a tissueform-server? Its gateway and a proxy have other ports");
}

}  // namespace tissueform
