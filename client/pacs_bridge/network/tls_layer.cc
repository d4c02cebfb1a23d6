// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/tls_layer.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmtls/tlslayer.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

// What is wrong with the files is said here: DCMTK would say it in a log.
absl::Status CheckFiles(const TlsFiles& files) {
  if (files.certificate.empty() || files.authorities.empty()) {
    return absl::InvalidArgumentError(
        "TLS for DICOM needs a certificate, its key and authorities: give --dicom-cert, "
        "--dicom-key and --dicom-ca");
  }
  TF_ASSIGN_OR_RETURN(const TlsContents contents, ReadTlsFiles(files));
  return CheckTlsContents(files, contents).status();
}

// An address is compared with addresses in the certificate, a name with names.
void ExpectHost(SSL_CTX* context, const std::string& host) {
  X509_VERIFY_PARAM* wanted = SSL_CTX_get0_param(context);
  if (X509_VERIFY_PARAM_set1_ip_asc(wanted, host.c_str()) == 1) return;
  X509_VERIFY_PARAM_set_hostflags(wanted, X509_CHECK_FLAG_NO_PARTIAL_WILDCARDS);
  X509_VERIFY_PARAM_set1_host(wanted, host.c_str(), host.size());
}

}  // namespace

absl::StatusOr<std::shared_ptr<DcmTransportLayer>> MakeTlsLayer(const TlsFiles& files, TlsRole role,
                                                                const std::string& host) {
  TF_RETURN_IF_ERROR(CheckFiles(files));
  auto layer = std::make_unique<DcmTLSTransportLayer>(
      role == TlsRole::kReceiver ? NET_ACCEPTOR : NET_REQUESTOR, nullptr, OFTrue);
  OFCondition made = layer->setTLSProfile(TSP_Profile_BCP195);
  if (made.good()) made = layer->activateCipherSuites();
  // OpenSSL's own call, since DCMTK reads one certificate and no chain.
  SSL_CTX* context = layer->getNativeHandle();
  if (made.bad() || context == nullptr ||
      SSL_CTX_use_certificate_chain_file(context, files.certificate.c_str()) != 1 ||
      layer->setPrivateKeyFile(files.key.c_str(), DCF_Filetype_PEM).bad() ||
      !layer->checkPrivateKeyMatchesCertificate() ||
      SSL_CTX_load_verify_locations(context, files.authorities.c_str(), nullptr) != 1) {
    return absl::InvalidArgumentError(
        absl::StrCat(files.certificate, ": OpenSSL refuses it, its key or ", files.authorities,
                     " for TLS of the profile BCP 195; keys of RSA need 2048 "
                     "bits"));
  }
  layer->setCertificateVerification(DCV_requireCertificate);
  if (!host.empty()) ExpectHost(context, host);
  return layer;
}

}  // namespace tissueform
