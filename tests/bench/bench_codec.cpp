// bench_codec: bytes and thread CPU time of the surface codec on a synthetic stream of soft tissue,
// and on the stream of a recorded session.
//
// 100 x 100 vertices on a jittered, curved patch, 1 mm apart. A tool follows a Lissajous path at 30
// to 50 mm/s and indents the patch by 1 to 6 mm with drag and pinch, lifting off every 2.5 s. Each
// vertex follows its target as a 5 Hz oscillator with damping ratio 0.6, so motion rings and
// settles. 600 frames at 62.5 Hz. Every decoded surface is compared with the encoded one; the CRC
// chained over all payloads ties the speed to the bytes.

#include <CLI/CLI.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <vector>

#include "common/base/checksum.h"
#include "common/base/exit_code.h"
#include "common/base/program.h"
#include "common/base/timing.h"
#include "common/journal/session_journal.h"
#include "common/math/morton.h"
#include "common/wire/surface_codec.h"

namespace {

using namespace trocar;        // NOLINT: a program's own file
using namespace trocar::wire;  // NOLINT

constexpr int kSide = 100;
constexpr int kFrames = 600;
constexpr float kFrameSeconds = 0.016f;

struct Scenario {
  const char* name;
  float radius_m;   // of the indentation
  float noise_m;    // standard deviation, of the solver, where tissue moves
  std::size_t lag;  // frames between baseline and frame
  // Design page (network-and-recording, 2.8): changed vertices at lag 1, bytes per frame; 0
  // unknown.
  double design_vertices, design_bytes, design_encode_us, design_decode_us;
};
constexpr Scenario kScenarios[] = {
    {"small", 0.0038f, 0, 1, 232, 353, 4, 3},
    {"small, lag 4", 0.0038f, 0, 4, 0, 547, 0, 0},
    {"medium", 0.0099f, 0, 1, 1269, 1362, 19, 14},
    {"medium + 12 um noise", 0.0099f, 12e-6f, 1, 1417, 1768, 22, 17},
    {"medium, lag 4", 0.0099f, 0, 4, 0, 2136, 0, 0},
    {"medium, lag 12", 0.0099f, 0, 12, 0, 2906, 0, 0},
    {"large", 0.0179f, 0, 1, 3075, 2908, 45, 34},
    {"large + 12 um noise", 0.0179f, 12e-6f, 1, 3435, 4028, 51, 39},
};

class Random {
 public:
  float signed_unit() {  // in [-1, 1)
    state_ = state_ * 6364136223846793005u + 1442695040888963407u;
    return static_cast<float>(static_cast<std::int32_t>(state_ >> 32)) * 0x1p-31f;
  }

 private:
  std::uint64_t state_ = 1;
};

// The patch in Morton order, and its motion.
class Tissue {
 public:
  Tissue() {
    std::vector<Vec3d> rest;
    for (int row = 0; row < kSide; ++row)
      for (int column = 0; column < kSide; ++column) {
        const double x = (column - kSide / 2) * 1e-3 + 2e-4 * random_.signed_unit();
        const double z = (row - kSide / 2) * 1e-3 + 2e-4 * random_.signed_unit();
        rest.push_back({x, -4 * (x * x + z * z), z});
      }
    for (const std::uint32_t i : morton_order(rest)) rest_.push_back(to_float(rest[i]));
    displacement_.resize(rest_.size());
    velocity_.resize(rest_.size());
  }

  // Displacements of the next frame.
  std::vector<Vec3f> next_frame(const Scenario& scenario) {
    for (int step = 0; step < 4; ++step) advance(scenario, kFrameSeconds / 4);
    std::vector<Vec3f> shown = displacement_;
    if (scenario.noise_m > 0)
      for (Vec3f& d : shown)
        if (length(d) > 20e-6f)
          d += Vec3f{random_.signed_unit(), random_.signed_unit(), random_.signed_unit()} *
               (std::numbers::sqrt3_v<float> * scenario.noise_m);
    return shown;
  }

 private:
  void advance(const Scenario& scenario, float seconds) {
    constexpr float kOmega = 2 * std::numbers::pi_v<float> * 5;
    constexpr float kDamping = 2 * 0.6f * kOmega;
    time_ += seconds;
    const float a = 1.31f * time_, b = 0.93f * time_ + 0.5f;
    const Vec3f tip{0.028f * std::sin(a), 0, 0.028f * std::sin(b)};
    const Vec3f tip_velocity{0.028f * 1.31f * std::cos(a), 0, 0.028f * 0.93f * std::cos(b)};
    const float phase = std::fmod(time_, 2.5f) / 2.5f;
    const float depth =
        phase < 0.8f
            ? 1e-3f + 5e-3f * std::pow(std::sin(std::numbers::pi_v<float> * phase / 0.8f), 2.0f)
            : 0.0f;
    const float reach = 3 * scenario.radius_m;
    for (std::size_t i = 0; i < rest_.size(); ++i) {
      const Vec3f r{rest_[i].x - tip.x, 0, rest_[i].z - tip.z};
      const float distance_squared = length_squared(r);
      Vec3f target;
      if (distance_squared < reach * reach) {
        const float q = 1 - distance_squared / (reach * reach);
        const float fall = depth * q * q * q * q;
        target = tip_velocity * (8 * fall) + r * (-0.15f * fall / scenario.radius_m);
        target.y = -fall;
      }
      velocity_[i] +=
          ((target - displacement_[i]) * (kOmega * kOmega) - velocity_[i] * kDamping) * seconds;
      displacement_[i] += velocity_[i] * seconds;
    }
  }

  Random random_;
  std::vector<Vec3f> rest_, displacement_, velocity_;
  float time_ = 0;
};

// Microseconds of thread CPU time, one value per frame.
class Times {
 public:
  template <typename Work>
  void measure(Work work) {
    const std::uint64_t start = thread_cpu_ns();
    work();
    us_.push_back(static_cast<double>(thread_cpu_ns() - start) * 1e-3);
  }
  double quantile(double q) {
    std::sort(us_.begin(), us_.end());
    return us_[static_cast<std::size_t>(q * static_cast<double>(us_.size() - 1))];
  }

 private:
  std::vector<double> us_;
};

struct Sums {
  std::size_t vertices = 0, bytes = 0, largest = 0, key_bytes = 0;
  std::uint32_t crc = 0;
};

bool measure(const Scenario& scenario, const std::vector<QuantisedSurface>& frames,
             double quantise_us) {
  Times encode_times, decode_times, crc_times, key_encode_times, key_decode_times;
  Sums sums;
  Bytes payload, key;
  QuantisedSurface decoded;
  bool same = true;
  std::size_t count = 0;
  for (std::size_t i = scenario.lag; i < frames.size(); ++i, ++count) {
    const QuantisedSurface& baseline = frames[i - scenario.lag];
    payload.clear();
    EncodeReport report;
    encode_times.measure([&] { report = encode_delta(baseline, frames[i], payload); });
    decoded = baseline;
    decode_times.measure([&] { same &= decode_delta(payload, decoded).ok(); });
    same &= decoded == frames[i];
    crc_times.measure([&] { sums.crc ^= surface_crc(decoded); });
    sums.vertices += report.changed_vertices;
    sums.bytes += payload.size();
    sums.largest = std::max(sums.largest, payload.size());
    sums.crc = crc32(payload, sums.crc);
    if (i % 10 != 0) continue;
    key.clear();
    key_encode_times.measure([&] { encode_keyframe(frames[i], key); });
    key_decode_times.measure([&] { same &= decode_keyframe(key, decoded).ok(); });
    same &= decoded == frames[i];
    sums.key_bytes = std::max(sums.key_bytes, key.size());
  }
  const auto mean = [count](std::size_t sum) {
    return static_cast<double>(sum) / static_cast<double>(count);
  };
  std::printf(
      "%-22s %5.0f %5.0f %5.0f %5.0f %5.2f %6zu | %5.1f %5.1f %5.0f | %5.1f %5.1f %5.0f | %5.1f "
      "%5.1f | %6zu %5.1f %5.1f | %08x%s\n",
      scenario.name, mean(sums.vertices), scenario.design_vertices, mean(sums.bytes),
      scenario.design_bytes, static_cast<double>(sums.bytes) / static_cast<double>(sums.vertices),
      sums.largest, encode_times.quantile(0.5), encode_times.quantile(0.99),
      scenario.design_encode_us, decode_times.quantile(0.5), decode_times.quantile(0.99),
      scenario.design_decode_us, quantise_us, crc_times.quantile(0.5), sums.key_bytes,
      key_encode_times.quantile(0.5), key_decode_times.quantile(0.5), sums.crc,
      same ? "" : "  DECODED SURFACE DIFFERS");
  return same;
}

bool measure_synthetic(const Scenario& scenario) {
  Tissue tissue;
  std::vector<QuantisedSurface> frames(1, QuantisedSurface(kSide * kSide));
  Times quantise_times;
  for (int i = 0; i < kFrames; ++i) {
    const auto displacements = tissue.next_frame(scenario);
    QuantisedSurface next = frames.back();
    quantise_times.measure([&] { quantise(displacements, next); });
    frames.push_back(std::move(next));
  }
  return measure(scenario, frames, quantise_times.quantile(0.5));
}

// The surface stream of a recorded session, as its clients saw it.
Result<std::vector<QuantisedSurface>> read_stream(const std::string& path) {
  auto journal = journal::SessionJournal::open(path);
  if (!journal) return journal.error();
  const Tick last = (*journal)->info().last_tick;
  const auto topology = (*journal)->topology_before(last);
  if (!topology) return topology.error();
  const Error no_surface{ErrorCode::BadFile, path + ": holds no surface stream"};
  if (!topology->has_value()) return no_surface;
  const auto vertex_count = static_cast<std::size_t>((*topology)->rest_position_quanta_size()) / 3;
  std::vector<QuantisedSurface> frames(1, QuantisedSurface(vertex_count));
  const auto first_key = (*journal)->surface_key_before(kTicksPerFrame);
  if (!first_key || !first_key->has_value() ||
      !decode_keyframe(bytes_of(std::string_view((*first_key)->payload())), frames.front()))
    return no_surface;
  Status decoded;
  const auto read =
      (*journal)->read_surface_deltas(0, last, [&](Tick, const proto::SurfaceFrame& frame) {
        QuantisedSurface next = frames.back();
        decoded = decode_delta(bytes_of(std::string_view(frame.payload())), next);
        frames.push_back(std::move(next));
        return decoded.ok();
      });
  if (!read.ok()) return read.error();
  if (!decoded.ok()) return Error{ErrorCode::BadFile, path + ": " + decoded.error().message};
  return frames;
}

bool measure_recorded(const std::string& path) {
  const auto frames = read_stream(path);
  if (!frames) return report("bench_codec", frames.error()) == 0;
  bool same = true;
  for (const std::size_t lag : {1u, 4u, 12u}) {
    const std::string name = "recorded, lag " + std::to_string(lag);
    same &= measure({name.c_str(), 0, 0, lag, 0, 0, 0, 0}, *frames, 0);
  }
  return same;
}

}  // namespace

int main(int argc, char** argv) {
  begin_program("bench_codec");
  CLI::App app{
      "Bytes and time of the surface codec on a synthetic stream, beside the design's figures."};
  app.footer(
      "Examples:\n  bench_codec\n  bench_codec out/demo/session.mcap\n\nTimes are thread CPU "
      "microseconds per frame. 'page' columns are "
      "the "
      "design's figures, 0 where it\ngives none; its encode times leave out the scan for changes "
      "(30 us), ours hold it.");
  std::string recording;
  app.add_option("JOURNAL", recording, "a recorded session (.mcap) to measure too");
  CLI11_PARSE(app, argc, argv);

  std::printf("%-22s %11s %11s %5s %6s | %17s | %17s | %11s | %18s | chained\n", "", "changed",
              "bytes", "", "", "encode us", "decode us", "us", "keyframe");
  std::printf(
      "%-22s %5s %5s %5s %5s %5s %6s | %5s %5s %5s | %5s %5s %5s | %5s %5s | %6s %5s %5s | CRC\n",
      "10,000 vertices", "mean", "page", "mean", "page", "B/v", "peak", "p50", "p99", "page", "p50",
      "p99", "page", "quant", "CRC", "bytes", "enc", "dec");
  bool same = true;
  for (const Scenario& scenario : kScenarios) same &= measure_synthetic(scenario);
  if (!recording.empty()) same &= measure_recorded(recording);
  return static_cast<int>(same ? ExitCode::Ok : ExitCode::Mismatch);
}
