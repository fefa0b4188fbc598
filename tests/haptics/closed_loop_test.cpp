#include <gtest/gtest.h>

#include <cstdio>

#include "tests/haptics/motions.h"

namespace trocar::haptics::testing {
namespace {

TEST(Table, Print) {
  for (double rtt : {0.0, 0.025, 0.05, 0.1, 0.15}) {
    for (const char* scheme : {"model", "hold", "lin", "lin5", "arrival", "noprony", "noreref"}) {
      const std::string n = scheme;
      if (rtt != 0.1 && rtt != 0.05 && n != "model") continue;
      std::printf("%3.0f %-8s", rtt * 1e3, scheme);
      double g[4] = {1, 1, 1, 1}, ph[4] = {}, st = 0, work = 0, step = 0, free_n = 0, cyc[2] = {},
             tcyc[2] = {};
      for (int m = 0; m < 10; ++m) {
        double sum = 0;
        for (const Trial& t : trials()) {
          const double k = t.tissue.stiffness_n_m;
          const Motion motion = m == 0   ? press(k)
                                : m == 1 ? palpation(k, 0.5)
                                : m == 2 ? palpation(k, 1)
                                : m == 3 ? palpation(k, 3)
                                : m == 4 ? taps(k)
                                : m == 5 ? slide(k)
                                : m == 6 ? grasp(k)
                                : m == 7 ? release(k)
                                : m == 8 ? topology(k)
                                         : lifted(k);
          wire::HapticLaw law = client_law(t.tissue, t.guess);
          const auto make = [&]() -> std::unique_ptr<Client> {
            if (n == "hold") return make_hold();
            if (n == "lin") return make_linear(1);
            if (n == "lin5") return make_linear(5);
            if (n == "arrival")
              return make_model(probe(), law, {}, [](wire::HapticPatch& p, std::uint64_t now) {
                p.echo_time_us = now;
              });
            if (n == "noprony") law.relaxation = {};
            TouchSettings settings;
            if (n == "noreref") settings.moved_share = 0;
            return make_model(probe(), law, settings);
          };
          const Outcome o = run(motion, t.tissue, make, {.rtt_s = rtt});
          sum += o.rms / 3;
          if (motion.frequency_hz > 0) {
            if (std::abs(o.gain - 1) > std::abs(g[m] - 1)) g[m] = o.gain;
            if (std::abs(o.phase_deg) > std::abs(ph[m])) ph[m] = o.phase_deg;
          }
          if (m == 2 || m == 3) {
            if (o.cycle_mj > cyc[m - 2] || !cyc[m - 2])
              cyc[m - 2] = o.cycle_mj, tcyc[m - 2] = o.true_cycle_mj;
          }
          if (m == 0 && std::abs(o.steady) > std::abs(st)) st = o.steady;
          work = std::max(work, o.work_mj);
          if (m != 6) step = std::max(step, o.step_n);
          free_n = std::max(free_n, o.free_n);
        }
        std::printf("%6.1f", sum * 100);
      }
      std::printf(
          " | g %.3f %.3f %.3f ph %+.0f %+.0f %+.0f st %+.2f%% work %.2f step %.3f free %.3f cyc "
          "%.2f(%.2f) %.2f(%.2f)\n",
          g[1], g[2], g[3], ph[1], ph[2], ph[3], st * 100, work, step, free_n, cyc[0], tcyc[0],
          cyc[1], tcyc[1]);
    }
  }
}

}  // namespace
}  // namespace trocar::haptics::testing
