// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Bearer } from "../calls/bearer";
import { Login } from "./login";
import type { LoginConfig } from "./login_config";
import { OidcProvider } from "./provider";

/** The login of a page whose server has logins; pages of other servers do not fetch this part. */
export function oidcLogin(config: LoginConfig, bearer: Bearer): Login {
  return new Login(new OidcProvider(config), config.issuer, bearer);
}
