// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

export type KernelKind = "soft" | "bone" | "unknown";

/** From which number on Siemens' kernels are sharp (B60s, H60s, Hr59 are; B30f, J40s are not). */
const SHARP_NUMBER = 50;
const LONGEST_NAME = 32;

/** A kernel as a scanner names it, "H60s\\3"; a text of another form may be anything, and does not leave the worker. */
export function kernelName(text: string): string {
  return text.length <= LONGEST_NAME && /^[A-Za-z0-9 ._+\\/-]*$/.test(text) ? text : "";
}

/** By the names that manufacturers give their kernels, as core/imaging/series/kernel_kind.h. */
export function kernelKindOf(kernel: string): KernelKind {
  const upper = kernel.toUpperCase();
  if (["BONE", "EDGE", "SHARP", "LUNG", "DETAIL"].some((word) => upper.includes(word))) return "bone";
  if (["SOFT", "STANDARD", "STND", "SMOOTH", "BRAIN"].some((word) => upper.includes(word))) return "soft";
  const digits = /^[A-Z]+(\d+)/.exec(upper)?.[1] ?? "";
  if (digits.length !== 2) return "unknown";
  const number = Number(digits);
  if (upper.startsWith("FC")) return (number >= 30 && number < 40) || number >= 50 ? "bone" : "soft";
  return number >= SHARP_NUMBER ? "bone" : "soft";
}
