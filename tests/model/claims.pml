/* The rules of ownership, as server/tissue/hands/claims.cpp has them. docs/ownership-model.md says what
 * the model keeps and what it leaves out; check_claims.sh runs it. Names in comments are those of the
 * C++ functions.
 *
 * One process is the server's tick with all that may come between two ticks. Nodes are bits of a byte.
 * Ticks of leases and ramps are few here (LEASE stands for kLeaseTicks and so on): only their order
 * matters, LEASE < ABANDON.
 *
 * The defines NO_... each switch one rule off; then spin must find an error.
 */

#ifndef TOOLS
#define TOOLS 3
#endif
#ifndef NODES
#define NODES 2
#endif
#ifndef LEASE
#define LEASE 1
#endif
#ifndef ABANDON
#define ABANDON 2
#endif
#define RAMP 1
#ifndef ABANDON_RAMP
#define ABANDON_RAMP 2
#endif
#define ALL ((1 << NODES) - 1)
#define NOBODY TOOLS

/* Verbs. */
#define NONE 0
#define PUSH 1
#define GRASP 2
#define CUT 3

/* Phases of a claim. FREE is ClaimPhase::None. */
#define FREE 0
#define WANTED 1
#define HELD 2
#define RAMPING 3
#define SPENT 4

/* What the server knows of a tool. */
bool seen[TOOLS]   /* is here, and has sent a sample */
byte silent[TOOLS] /* ticks since the last sample that arrived; counted up to ABANDON + 1 */
byte verb[TOOLS]   /* of the last sample */
byte core[TOOLS]   /* nodes in reach of the last sample */

/* The table. */
byte owner[NODES]  /* ClaimTable::owners_ */
byte phase[TOOLS]
byte wants[TOOLS]  /* Claim::verb */
byte rank[TOOLS]   /* order of Claim::first_refusal_tick: 0 of who waits for nothing, 1 the earliest */
byte ramp[TOOLS]   /* ticks left */
byte held[TOOLS]   /* what the tool acts on as its own: GraspTable's nodes, or the blade's core */

#ifdef NO_RETURN_CHECK
byte lost[TOOLS]   /* what it held when it was lost */
#endif

#ifdef LIVENESS
/* One tool wants ME_CORE and goes on wanting it, and its samples arrive. */
byte overtaken     /* how often others were granted a node of ME_CORE while it was waiting */
#endif

/* Scratch of a tick. */
byte t, n, i, h, best, newest, holder
bool asks[TOOLS]
bool stopped[TOOLS] /* a blade that held, and was refused in this tick */

#define has(set, node) (((set) >> (node)) & 1)
#ifdef NO_LEASE
#define is_living(tool) (seen[tool])
#else
#define is_living(tool) (seen[tool] && silent[tool] <= LEASE)
#endif

inline clear(tool) { phase[tool] = FREE; wants[tool] = NONE; rank[tool] = 0; ramp[tool] = 0 }

inline release_core(tool) {
  for (n : 0 .. NODES - 1) { if :: owner[n] == tool -> owner[n] = NOBODY :: else fi }
  held[tool] = 0
}

inline start_ramp(tool, ticks) {
#ifdef NO_RETURN_CHECK
  lost[tool] = held[tool];
#endif
  release_core(tool);
  phase[tool] = RAMPING;
  rank[tool] = 0;
  ramp[tool] = ticks
}

/* ClaimTable::leave, at the beginning of the next tick: that tick's update counts the ramp down once. */
inline leave(tool) {
  if
  :: phase[tool] == HELD && wants[tool] == GRASP -> start_ramp(tool, RAMP + 1)
  :: phase[tool] != RAMPING && !(phase[tool] == HELD && wants[tool] == GRASP) ->
    if :: wants[tool] == CUT -> release_core(tool) :: else fi;
    clear(tool)
  :: else
  fi;
  seen[tool] = false; silent[tool] = 0; verb[tool] = NONE; core[tool] = 0
}

/* GraspTable::update_slip and ClaimTable::slip_off: a grasp loses a node, or its last one. */
inline slip(tool, node) {
  held[tool] = held[tool] & ~(1 << node);
  owner[node] = NOBODY;
  if :: held[tool] == 0 -> phase[tool] = SPENT; rank[tool] = 0 :: else fi
}

/* ClaimTable::let_go, when the organ returns to the mark. */
inline let_go() {
  for (n : 0 .. NODES - 1) { owner[n] = NOBODY }
  for (t : 0 .. TOOLS - 1) {
    held[t] = 0;
    if
    :: (phase[t] == HELD || phase[t] == SPENT) && wants[t] != PUSH ->
      phase[t] = SPENT; rank[t] = 0; ramp[t] = 0
    :: else -> clear(t)
    fi
  }
}

/* The first loop of ClaimTable::update: what ends, ends before anything is granted. */
inline end_claims() {
  for (t : 0 .. TOOLS - 1) {
    if
    :: phase[t] == RAMPING ->
      ramp[t]--;
      if :: ramp[t] == 0 -> clear(t) :: else fi
    :: else
    fi
  }
  for (t : 0 .. TOOLS - 1) {
    if
    :: seen[t] && phase[t] == HELD && verb[t] != wants[t] -> release_core(t); clear(t)
    :: seen[t] && (phase[t] == WANTED || phase[t] == SPENT) && verb[t] != wants[t] -> clear(t)
#ifndef NO_LEASE
    :: seen[t] && phase[t] == HELD && verb[t] == wants[t] && wants[t] == GRASP && silent[t] > ABANDON ->
      start_ramp(t, ABANDON_RAMP)
    :: seen[t] && phase[t] == HELD && verb[t] == wants[t] && wants[t] != GRASP && silent[t] > LEASE ->
      start_ramp(t, RAMP)
#endif
    :: else
    fi
  }
}

/* Who asks. Pushes are granted on the way: they are shared. */
inline collect_requests() {
  newest = 1;
  for (t : 0 .. TOOLS - 1) { if :: rank[t] >= newest -> newest = rank[t] + 1 :: else fi }
  for (t : 0 .. TOOLS - 1) {
    asks[t] = false;
    if
    :: is_living(t) && verb[t] != NONE && (phase[t] == FREE || phase[t] == WANTED ||
                                           (phase[t] == HELD && wants[t] == CUT)) ->
      if
      :: verb[t] == PUSH -> phase[t] = HELD; wants[t] = PUSH
      :: else ->
        asks[t] = true;
        if :: phase[t] == FREE -> phase[t] = WANTED; wants[t] = verb[t]; rank[t] = newest :: else fi
      fi
    :: else
    fi
  }
}

/* ClaimTable::holder_of. */
inline find_holder(tool) {
  holder = NOBODY;
#ifndef NO_EXCLUSION
  for (n : 0 .. NODES - 1) {
    if
    :: holder == NOBODY && has(core[tool], n) && owner[n] != NOBODY && owner[n] != tool ->
      if :: is_living(owner[n]) -> holder = owner[n] :: else fi
    :: else
    fi
  }
#endif
}

inline take_over(tool) {
  for (i : 0 .. NODES - 1) {
    h = owner[i];
    if
#ifndef NO_EXCLUSION
    :: has(core[tool], i) && h != NOBODY && h != tool -> assert(!is_living(h)); start_ramp(h, RAMP)
#endif
    :: else
    fi
  }
  for (n : 0 .. NODES - 1) { if :: has(core[tool], n) -> owner[n] = tool :: else fi }
  held[tool] = core[tool];
  phase[tool] = HELD;
  wants[tool] = verb[tool];
  rank[tool] = 0
#ifdef BOUND
  ;
  if
  :: tool != ME && phase[ME] == WANTED && (core[tool] & ME_CORE) -> overtaken++
  :: else
  fi
#endif
}

#ifdef PARTIAL_GRANTS
/* Another rule, which the program does not have: take what is free and wait for the rest. */
inline take_free_part(tool) {
  for (n : 0 .. NODES - 1) {
    if
    :: has(core[tool], n) && owner[n] == NOBODY -> owner[n] = tool; held[tool] = held[tool] | (1 << n)
    :: else
    fi
  }
}
#endif

/* ClaimTable::decide_grasp and decide_cut. */
inline decide(tool) {
  if :: verb[tool] == CUT -> release_core(tool) :: else fi;
  find_holder(tool);
  if
  :: (verb[tool] == GRASP && core[tool] == 0) || holder != NOBODY ->
    if :: phase[tool] == HELD -> phase[tool] = WANTED; rank[tool] = newest; stopped[tool] = true :: else fi
#ifdef PARTIAL_GRANTS
    ; take_free_part(tool)
#endif
  :: else ->
    take_over(tool)
  fi
}

/* In the order (tick of the first refusal, tool). A blade that holds goes first: its rank is 0. */
inline decide_all() {
  do
  :: best = NOBODY;
    for (t : 0 .. TOOLS - 1) {
      if
      :: asks[t] && best == NOBODY -> best = t
#ifndef NO_TIE_RULE
      :: asks[t] && best != NOBODY -> if :: rank[t] < rank[best] -> best = t :: else fi
#endif
      :: else
      fi
    }
    if
    :: best == NOBODY -> break
    :: else -> asks[best] = false; decide(best)
    fi
  od
}

/* Ranks are numbered anew, without gaps. Forgotten is what cannot matter any more: a core is asked
 * for only by who waits, or cuts, and silence matters only to who has or wants something. */
inline forget() {
  for (i : 1 .. TOOLS) {
    h = NOBODY;
    for (t : 0 .. TOOLS - 1) {
      if
      :: rank[t] >= i && h == NOBODY -> h = t
      :: rank[t] >= i && h != NOBODY -> if :: rank[t] < rank[h] -> h = t :: else fi
      :: else
      fi
    }
    if
    :: h != NOBODY && rank[h] > i ->
      best = rank[h];
      for (t : 0 .. TOOLS - 1) { if :: rank[t] == best -> rank[t] = i :: else fi }
    :: else
    fi
  }
  for (t : 0 .. TOOLS - 1) {
    if
    :: phase[t] == SPENT || (phase[t] == HELD && wants[t] != CUT) -> core[t] = 0
    :: else
    fi;
    if
    :: verb[t] == NONE && phase[t] == FREE -> silent[t] = 0
    :: silent[t] > LEASE && !(phase[t] == HELD && wants[t] == GRASP) -> silent[t] = ABANDON + 1
    :: else
    fi
  }
}

inline check() {
  for (t : 0 .. TOOLS - 1) {
    /* No deadlock: who waits holds nothing, so no circle of waiting can close... */
    assert(phase[t] != WANTED || held[t] == 0);
    /* ...and who waits and lives is kept waiting by somebody who lives, or has nothing in reach. A blade
     * that held and is stopped may wait a tick for one that moves away in the same tick: that one's core
     * is let go of only when its own turn comes. */
    if
    :: phase[t] == WANTED && is_living(t) && !stopped[t] ->
      find_holder(t);
      assert(holder != NOBODY || (wants[t] == GRASP && core[t] == 0))
    :: else
    fi
    /* Exclusion: nobody acts on a node that another holds, and both tables agree. */
    for (n : 0 .. NODES - 1) {
      assert(has(held[t], n) == (owner[n] == t));
      assert(!has(held[t], n) || (phase[t] == HELD && (wants[t] == GRASP || wants[t] == CUT)))
    }
    /* Release after loss: a silent blade or push ends with the lease, a grasp when it is abandoned. */
    assert(phase[t] != HELD || silent[t] <= (wants[t] == GRASP -> ABANDON : LEASE));
    /* A grasp holds something. */
    assert(!(phase[t] == HELD && wants[t] == GRASP) || held[t] != 0);
    /* Whoever has gone holds nothing. */
    assert(seen[t] || held[t] == 0)
  }
}

inline tick() {
  end_claims();
  collect_requests();
  decide_all();
  check();
  forget();
  for (t : 0 .. TOOLS - 1) { stopped[t] = false }
  t = 0; n = 0; i = 0; h = 0; best = 0; newest = 0; holder = 0
}

/* A sample arrives. After a silence the hand is back with it. */
inline sample(tool, a_verb, a_core) {
  seen[tool] = true; silent[tool] = 0;
  verb[tool] = a_verb; core[tool] = a_core
#ifdef NO_RETURN_CHECK
  ;
  if
  :: lost[tool] && a_verb == GRASP ->
    phase[tool] = HELD; wants[tool] = GRASP; held[tool] = lost[tool];
    for (n : 0 .. NODES - 1) { if :: has(lost[tool], n) -> owner[n] = tool :: else fi }
  :: else
  fi;
  lost[tool] = 0
#endif
}

/* What may come of a tool between two ticks. That a message is late or lost is the same for the server:
 * nothing arrives now, and anything may arrive later. */
inline do_anything(tool) {
  if
  :: d_step { seen[tool] -> if :: silent[tool] <= ABANDON -> silent[tool]++ :: else fi }
  :: d_step { seen[tool] -> silent[tool] = 0 } /* the same sample once more */
  :: d_step { sample(tool, NONE, 0); n = 0 }
#ifdef PUSHES
  :: d_step { sample(tool, PUSH, 0); n = 0 }
#endif
  :: select (what : 0 .. ALL);
    if
    :: d_step { sample(tool, GRASP, what); what = 0; n = 0 }
#ifdef BLADES
    :: d_step { sample(tool, CUT, what); what = 0; n = 0 }
#endif
    fi
#ifdef LEAVES
  :: d_step { seen[tool] -> leave(tool); n = 0 }
#endif
  :: !seen[tool]
#ifdef SLIPS
  :: phase[tool] == HELD && wants[tool] == GRASP ->
    select (what : 0 .. NODES - 1);
    if
    :: has(held[tool], what) -> d_step { slip(tool, what); what = 0 }
    :: else -> what = 0
    fi
#endif
  fi
}

#if defined(LIVENESS)
/* ME asks for ME_CORE at some time, its samples arrive, and it goes on asking. */
#define A ((ME + 1) % TOOLS)
#define B ((ME + 2) % TOOLS)
/* The others let go: each of them, again and again, holds nothing that ME wants. */
#define lets_go(tool) ((held[tool] & ME_CORE) == 0)
#define is_waiting (verb[ME] == GRASP && phase[ME] != HELD)
ltl served { ([] <> lets_go(A) && [] <> lets_go(B)) -> [] (is_waiting -> <> !is_waiting) }

init {
  byte what;
  d_step { for (n : 0 .. NODES - 1) { owner[n] = NOBODY } n = 0 }
  do
  :: atomic {
      if
      :: verb[ME] == NONE -> d_step { sample(ME, GRASP, ME_CORE); n = 0 }
      :: true
      fi;
      do_anything(A);
      do_anything(B);
      d_step {
        tick();
#ifdef BOUND
        if :: phase[ME] != WANTED -> overtaken = 0 :: else fi;
        assert(overtaken <= BOUND)
#endif
      }
    }
  od
}
#elif defined(HANDS_OF_TWO)
/* Two hands of two tools. Hand h closes its first tool on node h and then its second on the other
 * hand's node, and opens both when it has both. Rules for tools cannot keep hands from waiting for each
 * other in a circle. */
#define first(hand) (2 * (hand))
#define second(hand) (2 * (hand) + 1)
inline next_step(hand) {
  if
  :: phase[first(hand)] != HELD -> d_step { sample(first(hand), GRASP, 1 << (hand)); n = 0 }
  :: phase[first(hand)] == HELD && phase[second(hand)] != HELD ->
    d_step { sample(second(hand), GRASP, 1 << (1 - (hand))); n = 0 }
  :: phase[first(hand)] == HELD && phase[second(hand)] == HELD ->
    d_step { sample(first(hand), NONE, 0); sample(second(hand), NONE, 0); n = 0 }
  fi
}

init {
  d_step { for (n : 0 .. NODES - 1) { owner[n] = NOBODY } n = 0 }
  do
  :: atomic {
      if :: next_step(0) :: true fi;
      if :: next_step(1) :: true fi;
      d_step {
        tick();
        assert(!(phase[first(0)] == HELD && phase[second(0)] == WANTED &&
                 phase[first(1)] == HELD && phase[second(1)] == WANTED))
      }
    }
  od
}
#else
/* Any history: whatever may happen to any tool in any tick. */
init {
  byte who, what;
  d_step { for (n : 0 .. NODES - 1) { owner[n] = NOBODY } n = 0 }
  do
  :: atomic {
      who = 0;
      do
      :: who < TOOLS -> do_anything(who); who++
      :: else -> break
      od;
      who = 0;
#ifdef MARKS
      if :: d_step { let_go(); t = 0; n = 0 } :: true fi;
#endif
      d_step { tick() }
    }
  od
}
#endif
