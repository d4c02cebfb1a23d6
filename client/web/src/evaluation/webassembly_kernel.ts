// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { MULTIPLY_COLUMNS } from "../generated/multiply_columns";
import type { ColumnKernel } from "./column_kernel";

const PAGE_BYTES = 65536;
const ALIGNMENT = 64;

interface Exports {
  multiply1(columns: number, rows: number, count: number, factors: number, sums: number): void;
  multiply3(columns: number, rows: number, count: number, factors: number, sums: number): void;
}

/** Columns of so many numbers in all; null where the browser has no WebAssembly with vectors, or its page may not use it. */
export async function webassemblyKernel(floats: number): Promise<ColumnKernel | null> {
  try {
    const memory = new WebAssembly.Memory({ initial: Math.ceil((4 * floats) / PAGE_BYTES) + 1 });
    const binary = Uint8Array.from(atob(MULTIPLY_COLUMNS), (letter) => letter.charCodeAt(0));
    const { instance } = await WebAssembly.instantiate(binary, { env: { memory } });
    return new WebAssemblyKernel(memory, instance.exports as unknown as Exports);
  } catch {
    return null;
  }
}

/** Arrays lie one behind the other in a memory that does not grow: so they stay where they are. */
class WebAssemblyKernel implements ColumnKernel {
  readonly name = "webassembly";
  private end = ALIGNMENT;

  constructor(
    private readonly memory: WebAssembly.Memory,
    private readonly exports: Exports,
  ) {}

  floats(count: number): Float32Array {
    const first = this.end;
    this.end = Math.ceil((first + 4 * count) / ALIGNMENT) * ALIGNMENT;
    return new Float32Array(this.memory.buffer, first, count);
  }

  multiply(columns: Float32Array, rows: number, count: number, factors: Float32Array, width: number, sums: Float32Array): void {
    const { multiply1, multiply3 } = this.exports;
    const multiply = width === 3 ? multiply3 : multiply1;
    multiply(columns.byteOffset, rows, count, factors.byteOffset, sums.byteOffset);
  }
}
