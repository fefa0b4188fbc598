#include "server/hall/proof/proof.h"

#include <array>

#include "common/base/json.h"
#include "common/secure/digest.h"

namespace trocar::hall {
namespace {

constexpr std::size_t kOnceBytes = 16;

std::string random_number() {
  std::array<std::uint8_t, kOnceBytes> bytes{};
  secure::fill_random(bytes);
  return secure::to_hex(bytes);
}

BytesView view_of(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

secure::Digest proof_of(const std::string& hall, const std::string& start,
                        const BusRequest& request, const std::string& key) {
  // Lengths stand before texts, so that no two requests give the same bytes.
  std::string all;
  for (const auto& part : {hall, start, request.method, request.path, request.body, request.once})
    all += std::to_string(part.size()) + ":" + part + ";";
  all += std::to_string(request.unix_s);
  return secure::hmac_sha256(view_of(key), view_of(all));
}

std::string text_at(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
}

}  // namespace

std::string write_bus_request(const std::string& hall, const std::string& start,
                              const std::string& method, const std::string& path,
                              const std::string& body, const std::string& key,
                              std::int64_t unix_s) {
  BusRequest request{.method = method, .path = path, .body = body};
  Json json{{"method", method}, {"path", path}, {"body", body}};
  if (!key.empty()) {
    request.once = random_number();
    request.unix_s = unix_s;
    json["time"] = unix_s;
    json["once"] = request.once;
    json["proof"] = secure::to_hex(proof_of(hall, start, request, key));
  }
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

Result<BusRequest> read_bus_request(const std::string& text) {
  const auto json = Json::parse(text, nullptr, false);
  const Error bad{ErrorCode::BadMessage, "this is no request to a hall"};
  if (!json.is_object()) return bad;
  BusRequest request{.method = text_at(json, "method"),
                     .path = text_at(json, "path"),
                     .body = text_at(json, "body"),
                     .once = text_at(json, "once"),
                     .proof = text_at(json, "proof")};
  if (request.method.empty() || request.path.empty()) return bad;
  const auto time = json.find("time");
  if (time != json.end() && time->is_number_integer()) request.unix_s = time->get<std::int64_t>();
  return request;
}

ProofCheck::ProofCheck(std::string hall, std::string key)
    : hall_(std::move(hall)), key_(std::move(key)), start_(random_number()) {}

Proof ProofCheck::check(const BusRequest& request, std::int64_t now_unix_s) {
  if (request.proof.empty()) return Proof::None;
  std::erase_if(used_, [&](const auto& entry) { return entry.second < now_unix_s; });
  const bool is_now =
      request.unix_s >= now_unix_s - kMostSkew_s && request.unix_s <= now_unix_s + kMostSkew_s;
  const bool is_new = request.once.size() == 2 * kOnceBytes && !used_.contains(request.once) &&
                      used_.size() < kMostKept;
  const bool is_proved = secure::equal_in_constant_time(secure::from_hex(request.proof),
                                                        proof_of(hall_, start_, request, key_));
  if (!is_now || !is_new || !is_proved) return Proof::Wrong;
  used_[request.once] = request.unix_s + kMostSkew_s + 1;
  return Proof::Right;
}

}  // namespace trocar::hall
