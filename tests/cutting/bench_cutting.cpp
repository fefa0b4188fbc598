// Measures what a call of Cutter::cut() costs while blades go through an organ that sways, with a
// call per tick of 1 ms. It prints the median, the 99th percentile and the worst CPU time of all
// calls and of those that cut, how far the cutting stays behind the blade, and a hash of all edits,
// without which the times say nothing.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "common/base/timing.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/tissue/cutting/event_codec.h"
#include "tests/cutting/random_strokes.h"

namespace trocar::cutting::testing {
namespace {

struct Options {
  std::string organ;
  int ticks = 1000, strokes = 5, blades = 1;
  double speed_m_s = 0.1, depth_m = 0.04, sway_m = 0.005;
  std::uint64_t seed = 1;
  bool is_unknown = false;
  Settings settings;
};

struct Times {
  std::vector<double> us;

  double at(double share) {
    if (us.empty()) return 0;
    std::sort(us.begin(), us.end());
    return us[static_cast<std::size_t>(share * static_cast<double>(us.size() - 1))];
  }
  void print(const char* what) {
    std::printf("  %s: %zu calls, CPU median %.1f us, p99 %.1f us, worst %.1f us\n", what,
                us.size(), at(0.5), at(0.99), at(1));
  }
};

// A straight edge that stands in the tissue, moved across it.
struct Blade {
  Vec3d start, edge, motion;

  Edge at(double way) const {
    const Vec3d top = start + motion * way;
    return {top, top + edge * 0.5, top + edge};
  }
};

class Bench {
 public:
  explicit Bench(const Options& options)
      : options_(options),
        organ_(*catalogue::load_organ(options.organ)),
        topology_(organ_),
        cutter_(topology_, options.settings),
        random_(options.seed) {}

  void run() {
    for (int stroke = 0; stroke < options_.strokes; ++stroke) cut_once();
    Bytes bytes;
    encode(history_, bytes);
    const double h = cutter_.mean_h();
    std::printf("%s: %zu nodes, h %.2f mm, %d strokes of %d ticks at %.2f m/s, %d blades\n",
                options_.organ.c_str(), organ_.mesh.node_count(), h * 1e3, options_.strokes,
                options_.ticks, options_.speed_m_s, options_.blades);
    all_.print("all");
    cutting_.print("with edits");
    behind_h_.print("behind the blade, h instead of us");
    std::printf(
        "  crossed tets %llu, bytes per crossed tet %.2f, %llu calls left work, edits %016llx\n",
        static_cast<unsigned long long>(crossed_), double(bytes.size()) / double(crossed_),
        static_cast<unsigned long long>(calls_behind_),
        static_cast<unsigned long long>(xxh3_64(bytes)));
  }

 private:
  double any(double size) { return random_.between(-size, size); }

  void cut_once() {
    const auto normals = mesh::surface_normals(organ_.mesh);
    std::vector<Blade> blades;
    for (int b = 0; b < options_.blades; ++b) {
      const auto count = static_cast<std::uint32_t>(organ_.mesh.surface_nodes.size());
      const auto node = organ_.mesh.surface_nodes[random_.below(count)];
      const auto& normal = normals[node.value];
      const auto motion = normalized(cross(normal, Vec3d{any(1), any(1), any(1)}), Vec3d{1, 0, 0});
      const double way = options_.speed_m_s * options_.ticks / 1000;
      blades.push_back(
          {organ_.mesh.rest_positions[node.value] + normal * 0.005 - motion * (way / 2),
           normal * -options_.depth_m, motion});
    }
    for (int tick = 0; tick < options_.ticks; ++tick) {
      for (int b = 0; b < options_.blades; ++b)
        cutter_.move(b, blades[b].at(options_.speed_m_s * tick / 1000));
      call();
      for (int b = 0; b < options_.blades; ++b)
        behind_h_.us.push_back(cutter_.behind_m(b) / cutter_.mean_h());
    }
    for (int b = 0; b < options_.blades; ++b) cutter_.lift(b);
    while (!cutter_.is_idle()) call();
  }

  void call() {
    ++tick_;
    displacements_.resize(topology_.node_count());
    for (const auto& made : output_.new_nodes) {
      const auto a = displacements_[made.a.value], b = displacements_[made.b.value];
      displacements_[made.node.value] = a + (b - a) * (made.t / 65536.f);
    }
    const double phase = 0.006 * tick_;
    double farthest = 0;
    const Vec3d sway = Vec3d{std::sin(phase), std::cos(phase), 0} * options_.sway_m;
    for (std::size_t n = 0; n < displacements_.size(); ++n) {
      const auto& p = topology_.rest()[n];
      const auto now = to_float(sway * (1 + 5 * p.x + 3 * p.y));
      farthest = std::max(farthest, static_cast<double>(length_squared(now - displacements_[n])));
      displacements_[n] = now;
    }
    travel_m_ += std::sqrt(farthest);
    const auto start = thread_cpu_ns();
    cutter_.cut(displacements_, output_, options_.is_unknown ? kUnknownTravel : travel_m_);
    const double us = static_cast<double>(thread_cpu_ns() - start) / 1e3;
    all_.us.push_back(us);
    if (output_.splits + output_.labels > 0) cutting_.us.push_back(us);
    history_.append(output_.events);
    crossed_ += output_.crossed_tets;
    calls_behind_ += output_.is_behind;
  }

  const Options options_;
  const organ::Organ organ_;
  topology::Topology topology_;
  Cutter cutter_;
  trocar::testing::Random random_;
  std::vector<Vec3f> displacements_;
  CutOutput output_;
  CutEvents history_;
  Times all_, cutting_, behind_h_;
  std::uint64_t crossed_ = 0, calls_behind_ = 0;
  int tick_ = 0;
  double travel_m_ = 0;
};

int main(int argc, char** argv) {
  Options options;
  CLI::App app("What cutting costs per call");
  app.add_option("organ", options.organ, "liver, or a file")->required();
  app.add_option("--ticks", options.ticks, "per stroke");
  app.add_option("--strokes", options.strokes);
  app.add_option("--blades", options.blades, "at once");
  app.add_option("--speed", options.speed_m_s, "m/s");
  app.add_option("--depth", options.depth_m, "length of the blade, m");
  app.add_option("--sway", options.sway_m, "of the tissue, m");
  app.add_option("--edits", options.settings.edits_per_call);
  app.add_flag("--unknown-travel", options.is_unknown, "every node is looked at");
  app.add_option("--seed", options.seed);
  CLI11_PARSE(app, argc, argv);
  Bench(options).run();
  return 0;
}

}  // namespace
}  // namespace trocar::cutting::testing

int main(int argc, char** argv) {
  return trocar::cutting::testing::main(argc, argv);
}
