// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type AddressInfo, type Socket, connect, createServer } from "node:net";

/** A line to a server on which every byte is late, both ways. */
export class SlowLine {
  private readonly sockets = new Set<Socket>();
  private readonly server;
  /** Bytes that came from the server. */
  received = 0;

  private constructor(
    private readonly port: number,
    private readonly delayMs: number,
  ) {
    this.server = createServer({ noDelay: true }, (near) => {
      const far = connect({ port: this.port, host: "127.0.0.1", noDelay: true });
      far.on("data", (data) => (this.received += data.length));
      this.carry(near, far);
      this.carry(far, near);
    });
  }

  /** `url`: of the server. */
  static async open(url: string, delayMs: number): Promise<SlowLine> {
    const line = new SlowLine(Number(new URL(url).port), delayMs);
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

  close(): void {
    this.breakOff();
    this.server.close();
  }

  private carry(from: Socket, to: Socket): void {
    this.sockets.add(from);
    const later = (action: () => void) => setTimeout(() => !to.destroyed && action(), this.delayMs);
    from.on("data", (data) => later(() => to.write(data)));
    from.on("end", () => later(() => to.end()));
    from.on("error", () => to.destroy());
    from.on("close", () => {
      this.sockets.delete(from);
      later(() => to.destroy());
    });
  }
}
