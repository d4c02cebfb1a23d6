// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type AddressInfo, type Socket, connect, createServer } from "node:net";

/** A line to a server on which every byte is late, both ways. It can also be narrow, or go dead without closing. */
export class SlowLine {
  private readonly sockets = new Set<Socket>();
  private readonly muted = new Set<Socket>();
  private readonly server;
  /** Bytes that came from the server. */
  received = 0;
  /** Connections of the page's so far. */
  opened = 0;

  private constructor(
    private readonly port: number,
    private readonly delayMs: number,
    private readonly bytesPerSecond: number,
  ) {
    this.server = createServer({ noDelay: true }, (near) => {
      const far = connect({ port: this.port, host: "127.0.0.1", noDelay: true });
      far.on("data", (data) => (this.received += data.length));
      this.opened += 1;
      this.carry(near, far);
      this.carry(far, near);
    });
  }

  /** `url`: of the server; `bytesPerSecond`: of each connection, each way. */
  static async open(url: string, delayMs: number, bytesPerSecond = Infinity): Promise<SlowLine> {
    const line = new SlowLine(Number(new URL(url).port), delayMs, bytesPerSecond);
    await new Promise<void>((done) => line.server.listen(0, "127.0.0.1", done));
    return line;
  }

  get url(): string {
    return `http://127.0.0.1:${(this.server.address() as AddressInfo).port}`;
  }

  /** Connections break off; new ones are taken. */
  breakOff(): void {
    this.sockets.forEach((socket) => socket.destroy());
  }

  /** Connections stay open and carry nothing any more, not even that they end, as where a router has forgotten them; new ones work. */
  mute(): void {
    this.sockets.forEach((socket) => this.muted.add(socket));
  }

  close(): void {
    this.breakOff();
    this.server.close();
  }

  private carry(from: Socket, to: Socket): void {
    this.sockets.add(from);
    const later = (action: () => void) => setTimeout(() => !to.destroyed && !this.muted.has(from) && action(), this.delayMs);
    from.on("data", (data) => {
      later(() => to.write(data));
      if (this.bytesPerSecond === Infinity) return;
      from.pause();
      setTimeout(() => from.resume(), (1000 * data.length) / this.bytesPerSecond);
    });
    from.on("end", () => later(() => to.end()));
    from.on("error", () => this.muted.has(from) || to.destroy());
    from.on("close", () => {
      this.sockets.delete(from);
      later(() => to.destroy());
    });
  }
}
