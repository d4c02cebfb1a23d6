# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""What is done to a cluster under load, one thing after the other, and what must be so while it is."""

import random
import signal
import threading
import time

import arena as arena_module
import stack

MARGIN_S = 1  # a server answers until so long before its lease ends
RENEWAL_S = 3
BEYOND_LEASE_S = arena_module.LEASE_S + 3
CUT_OFF_S = 4  # a server without the database says so when its leases have ended, and proxies see it, so long after that
FOUND_AGAIN_S = 8  # proxies know by then that a server is there again
LATE_S = 2  # for what was stopped to show what it does when it goes on


class Scenarios:
    def __init__(self, arena, load, ledger, seed):
        self.arena, self.load, self.ledger = arena, load, ledger
        self.chance = random.Random(seed)
        self.begin = time.monotonic()
        self.victims = []

    def say(self, text):
        print(f"{time.monotonic() - self.begin:7.2f} s  {text}", flush=True)

    def check(self, condition, text):
        if not condition:
            self.ledger.violation(text)

    # kill -9

    def kills(self, count, seconds):
        """Kills at random moments; what was killed comes back after a random time. One server at least stays."""
        down, lock = set(), threading.Lock()

        def bring_back(name, event, after_s):
            time.sleep(after_s)
            try:
                self.arena.bring_back(name, event)
            except SystemExit as error:
                self.ledger.violation(f"{name} did not come back: {error}")
            with lock:
                down.discard(name)

        returning = []
        for number in range(count):
            time.sleep((self.chance.expovariate(1) + 1) * seconds / count / 2)
            after_s = self.chance.uniform(0.3, 4)
            with lock:
                name = self._victim(down)
                down.add(name)
            if name is None:
                continue
            event = self.arena.kill(name)
            self.victims.append(name)
            self.say(f"kill {number + 1}: {name} ({len(event.held)} sessions), back after {after_s:.1f} s")
            returning.append(threading.Thread(target=bring_back, args=(name, event, after_s)))
            returning[-1].start()
        for thread in returning:
            thread.join()

    def _victim(self, down):
        """Servers twice as often as gateways; one of each stays. None: all else is down."""
        cluster, chances = self.arena.cluster, []
        for names, weight, stay in ((cluster.nodes, 2, 1), (cluster.gateways, 1, 1), ([stack.HAPROXY], 2, 0)):
            alive = [name for name in names if name not in down]
            if len(alive) > stay:
                chances += alive * weight
        return self.chance.choice(chances) if chances else None

    def settle(self):
        """Until every drag shows frames again."""
        end = time.monotonic() + arena_module.LEASE_S + CUT_OFF_S + self.load.preparation_s + 2
        while time.monotonic() < end:
            now = time.monotonic()
            if all(drag.last_frame and now - drag.last_frame[0] < 0.5 for drag in self.load.drags):
                return
            time.sleep(0.1)
        for drag in self.load.drags:
            if not drag.last_frame or time.monotonic() - drag.last_frame[0] > 0.5:
                self.ledger.violation(f"the drag of {drag.session} does not go on: {drag.state()}")

    # An owner that is stopped, another one that is cut off from the database

    def _contested_owner(self):
        """The drag whose server holds the contested session: the one that was shown a frame last."""
        return max(self.load.rivals, key=lambda rival: rival.last_frame[0] if rival.last_frame else 0)

    def _freeze(self, process, what, held, late_s):
        stack.processes.send(process, signal.SIGSTOP)
        return self.arena.note(what, held, seen_after_s=late_s)

    def stop_and_split(self, stop=True, split=True):
        contested, rival = self.load.contested, self._contested_owner()
        epoch = self.arena.epoch_of(contested)
        process, frozen, events = self.arena.process_at(rival.address), [], []
        if stop:
            events.append(self._freeze(process, f"SIGSTOP {self.arena.name_at(rival.address)}", self.arena.held_by(rival.pinned), 0))
        if split:
            # Not one that is stopped; alone, the owner itself.
            node = next(name for name in self.arena.cluster.nodes if (name != rival.pinned) == stop)
            frozen.append(self.arena.links[node])
            events.append(self._freeze(frozen[0], f"database cut off from {node}", self.arena.held_by(node), CUT_OFF_S))
        self.say(", ".join(sorted({event.what for event in events})) + f"; {self.arena.name_at(rival.address)} holds the contested session under epoch {epoch}")
        time.sleep(BEYOND_LEASE_S)
        if stop:
            stack.processes.send(process, signal.SIGCONT)
        time.sleep(CUT_OFF_S if frozen else 0)
        for link in frozen:
            stack.processes.send(link, signal.SIGCONT)
        self.say("they go on")
        time.sleep(LATE_S)
        for event in events:
            event.back_at = time.monotonic()
        now, newer, kept = self._contested_owner(), self.arena.epoch_of(contested), self.load.kept_sequence(contested)
        by = self.ledger.sent_by(contested, kept)
        self.check(newer > epoch and now is not rival, f"{self.arena.name_at(rival.address)} was stopped beyond its lease and holds the contested session under epoch {newer} "
                   f"(it was {epoch})")
        self.check(by != rival.address, f"pose {kept} was sent to {self.arena.name_at(rival.address)} and is kept, though {self.arena.name_at(now.address)} holds the session")
        self.say(f"{self.arena.name_at(now.address)} holds it under epoch {newer}; the kept pose {kept} was sent to {self.arena.name_at(by)}")

    # A server that is updated

    def drain(self):
        held = {node: len(self.arena.held_by(node)) for node in self.arena.cluster.nodes}
        node = max(held, key=held.get)
        refused = sum(self.ledger.refused_commits.values())
        event = self.arena.note(f"drain {node}")
        self.say(f"SIGTERM {node} ({held[node]} sessions)")
        self.arena.cluster.kill(node, signal.SIGTERM)
        self.check(stack.processes.wait_until_gone(self.arena.cluster.process(node), 30), f"{node} does not end after SIGTERM")
        took_s = time.monotonic() - event.at
        time.sleep(0.5)
        # Its twin, which goes on under the same name, may have taken the one session that it is asked for.
        left = self.arena.held_by(node) - ({self.load.contested} if node == arena_module.TWIN_OF else set())
        self.check(not left, f"{node} has ended and holds sessions")
        self.check(sum(self.ledger.refused_commits.values()) == refused, "a commit was refused by a server that drained")
        self.say(f"{node} ended after {took_s:.1f} s")
        self.arena.bring_back(node, event)

    # A database that goes

    def restart_database(self):
        self.say("PostgreSQL is restarted")
        refused, commits = sum(self.ledger.refused_commits.values()), self.ledger.counts["commits"]
        event = self.arena.note("database restarted")
        self.arena.cluster.stop(stack.DATABASE)
        self.arena.cluster.start(stack.DATABASE)
        event.back_at = time.monotonic()
        time.sleep(4)
        self.check(self.ledger.counts["commits"] > commits, "no commit was kept after PostgreSQL was restarted")
        self.check(sum(self.ledger.refused_commits.values()) == refused, f"a commit was refused though PostgreSQL was away for {event.back_at - event.at:.1f} s only: "
                   f"{dict(self.ledger.refused_commits)}")

    def database_gone(self, seconds):
        self.say(f"PostgreSQL is away for {seconds} s")
        dragged = {drag: drag.last_frame for drag in self.load.drags}
        event = self.arena.note("database gone", stops_all=True, seen_after_s=FOUND_AGAIN_S)
        self.arena.cluster.stop(stack.DATABASE)
        last = arena_module.LEASE_S - MARGIN_S
        time.sleep(last + 0.5)
        stopped = self.ledger.counts["frames"]
        answered_s = [drag.last_frame[0] - event.at for drag in dragged]
        time.sleep(max(0, event.at + seconds - time.monotonic()))
        self.check(self.ledger.counts["frames"] == stopped, f"{self.ledger.counts['frames'] - stopped} frames came without a lease")
        self.check(min(answered_s) > last - RENEWAL_S - 0.5, f"a drag ended {min(answered_s):.1f} s after PostgreSQL did, though its lease was good for {last - RENEWAL_S} s at least")
        self.arena.cluster.start(stack.DATABASE)
        event.back_at = time.monotonic()
        self.say(f"PostgreSQL is back; poses were answered for {min(answered_s):.1f} to {max(answered_s):.1f} s")
