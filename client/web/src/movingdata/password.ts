// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

/** A moving file with fewer is not made. */
export const LEAST_PASSWORD_LETTERS = 8;
