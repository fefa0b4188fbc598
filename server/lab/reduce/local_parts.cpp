#include "server/lab/reduce/local_parts.h"

#include <cstring>
#include <fstream>
#include <string>

#include "common/base/bytes.h"
#include "common/base/text_file.h"
#include "server/organs/organ/packed_file.h"

namespace trocar::reduce {
namespace {

constexpr organ::PackedKind kKind{"TROCARLP", "a part of a reduction", "", "", 1, 1};
constexpr std::uint64_t kMostItems = std::uint64_t{1} << 32;

template <typename T>
void put_all(ByteWriter& out, const std::vector<T>& values) {
  out.put(static_cast<std::uint64_t>(values.size()));
  out.put_bytes({reinterpret_cast<const std::uint8_t*>(values.data()), values.size() * sizeof(T)});
}
template <typename T>
std::vector<T> pop_all(ByteReader& in) {
  const auto count = in.read<std::uint64_t>();
  if (count > kMostItems) return {};
  const auto bytes = in.read_bytes(count * sizeof(T));
  std::vector<T> values(bytes.size() / sizeof(T));
  if (!bytes.empty()) std::memcpy(values.data(), bytes.data(), bytes.size());
  return values;
}

std::filesystem::path file_of(const std::filesystem::path& folder, const char* what,
                              std::size_t number) {
  return folder / (what + std::to_string(number) + ".part");
}

std::optional<Bytes> body_of(const std::filesystem::path& path) {
  const auto file = organ::read_packed(path);
  if (!file) return std::nullopt;
  auto unpacked = organ::unpack(kKind, *file);
  if (!unpacked) return std::nullopt;
  return std::move(unpacked->body);
}

}  // namespace

Result<LocalParts> LocalParts::open(const std::filesystem::path& folder, const std::string& key) {
  LocalParts parts;
  parts.folder_ = folder;
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error)
    return Error{ErrorCode::BadFile, folder.string() + ": cannot be made: " + error.message()};
  const auto name = folder / "key.txt";
  if (std::ifstream in(name); in) {
    std::string found;
    std::getline(in, found);
    if (found != key)
      return Error{ErrorCode::Usage,
                   folder.string() +
                       ": is of a run with other settings or another organ: remove "
                       "it, or give the settings of that run"};
    return parts;
  }
  if (auto s = write_text_file(name, key + "\n"); !s) return s.error();
  return parts;
}

std::optional<Pressed> LocalParts::read_pressed(std::size_t number,
                                                std::size_t field_length) const {
  if (folder_.empty()) return std::nullopt;
  const auto body = body_of(file_of(folder_, "press-", number));
  if (!body) return std::nullopt;
  ByteReader in(*body);
  Pressed pressed;
  pressed.failed = in.read<std::uint64_t>();
  const auto count = in.read<std::uint64_t>();
  for (std::uint64_t i = 0; i < count && in.ok(); ++i) {
    const auto values = pop_all<double>(in);
    if (values.size() != field_length) return std::nullopt;
    pressed.fields.push_back(
        Eigen::Map<const Vector>(values.data(), static_cast<Eigen::Index>(values.size())));
  }
  if (!in.ok() || in.remaining() > 0) return std::nullopt;
  return pressed;
}

Status LocalParts::write(std::size_t number, const Pressed& pressed) const {
  if (folder_.empty()) return {};
  Bytes body;
  ByteWriter out(body);
  out.put(static_cast<std::uint64_t>(pressed.failed));
  out.put(static_cast<std::uint64_t>(pressed.fields.size()));
  for (const auto& field : pressed.fields)
    put_all(out, std::vector<double>(field.data(), field.data() + field.size()));
  return organ::write_packed(file_of(folder_, "press-", number), organ::pack(kKind, 1, body));
}

std::optional<FinishedPatch> LocalParts::read_patch(std::size_t number) const {
  if (folder_.empty()) return std::nullopt;
  const auto body = body_of(file_of(folder_, "patch-", number));
  if (!body) return std::nullopt;
  ByteReader in(*body);
  FinishedPatch patch;
  const auto modes = in.read<std::uint64_t>();
  for (std::uint64_t i = 0; i < modes && in.ok(); ++i) {
    auto& mode = patch.modes.emplace_back();
    mode.step = in.read<float>();
    mode.values = pop_all<std::int16_t>(in);
  }
  const auto tets = pop_all<std::uint32_t>(in);
  const auto weights = pop_all<float>(in);
  patch.outer_stiffness = pop_all<double>(in);
  patch.mass = pop_all<double>(in);
  patch.nonlinear = in.read<double>();
  patch.residual = in.read<double>();
  if (!in.ok() || in.remaining() > 0 || tets.size() != weights.size()) return std::nullopt;
  for (std::size_t i = 0; i < tets.size(); ++i)
    patch.cubature.push_back({TetIndex(tets[i]), weights[i]});
  return patch;
}

Status LocalParts::write(std::size_t number, const FinishedPatch& patch) const {
  if (folder_.empty()) return {};
  Bytes body;
  ByteWriter out(body);
  out.put(static_cast<std::uint64_t>(patch.modes.size()));
  for (const auto& mode : patch.modes) {
    out.put(mode.step);
    put_all(out, mode.values);
  }
  std::vector<std::uint32_t> tets;
  std::vector<float> weights;
  for (const auto& [tet, weight] : patch.cubature)
    tets.push_back(tet.value), weights.push_back(weight);
  put_all(out, tets);
  put_all(out, weights);
  put_all(out, patch.outer_stiffness);
  put_all(out, patch.mass);
  out.put(patch.nonlinear);
  out.put(patch.residual);
  return organ::write_packed(file_of(folder_, "patch-", number), organ::pack(kKind, 1, body));
}

}  // namespace trocar::reduce
