// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

namespace tissueform {

// How a server is reached and who one is there. Files are PEM.
struct ConnectionOptions {
  // Encrypted, to a server whose certificate names the host that was given; any TLS file below
  // also turns encryption on.
  bool tls = false;
  std::string tls_ca = {};  // authorities of the server's certificate; empty: the system's
  // One's own certificate and its key, for servers that ask for one.
  std::string tls_certificate = {};
  std::string tls_key = {};
  // File with the caller's token; reloaded when renewed. Only its owner may read it.
  std::string token_file = {};
  bool insecure = false;  // allow an unencrypted connection to another machine

  bool encrypted() const { return tls || !tls_ca.empty() || !tls_certificate.empty(); }
};

}  // namespace tissueform
