// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

/** The token that goes with every call. In memory only; "": without a token, as where the server has no logins. */
export class Bearer {
  private current = "";
  private readonly listeners = new Set<(token: string) => void>();
  /** Finds another token in place of one that the server does not take (`why`: its sentence); false where it cannot. */
  renewer: ((why: string) => Promise<boolean>) | null = null;

  get token(): string {
    return this.current;
  }

  set token(token: string) {
    this.current = token;
    this.listeners.forEach((listener) => listener(token));
  }

  get headers(): Record<string, string> {
    return this.current === "" ? {} : { authorization: `Bearer ${this.current}` };
  }

  /** `listener` hears of every new token until it calls the result. */
  watch(listener: (token: string) => void): () => void {
    this.listeners.add(listener);
    return () => this.listeners.delete(listener);
  }

  /** The server does not take `refused` and says `why`: whether there is another one now, with which the call may be made again. */
  async replace(refused: string, why: string): Promise<boolean> {
    if (this.current !== refused) return this.current !== "";
    return (await this.renewer?.(why)) ?? false;
  }
}
