#include "server/session/archive/s3_client.h"

#include <curl/curl.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <string_view>
#include <thread>

#include "common/base/printable.h"
#include "common/secure/digest.h"
#include "common/secure/loopback.h"

namespace trocar::archive {
namespace {

constexpr long kConnectSeconds = 10, kStillSeconds = 60;
constexpr std::size_t kMostReason = 200;

// host: a name or an address, one of version 6 in brackets.
bool is_this_machine(std::string host) {
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
  return host == "localhost" || secure::is_loopback(host);
}

// Encodes as signatures want it: everything but letters, digits and -._~ in hexadecimal.
std::string encoded(std::string_view text, bool keeps_slashes) {
  std::string out;
  for (const char c : text) {
    const bool is_plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                          (c >= '0' && c <= '9') || c == '-' || c == '.' || c == '_' || c == '~' ||
                          (c == '/' && keeps_slashes);
    if (is_plain)
      out += c;
    else
      out += fmt::format("%{:02X}", static_cast<unsigned char>(c));
  }
  return out;
}

std::size_t take_body(char* data, std::size_t size, std::size_t count, void* into) {
  auto& body = *static_cast<std::string*>(into);
  if (body.size() + size * count > S3Client::kMostAnswerBytes) return 0;
  body.append(data, size * count);
  return size * count;
}

std::size_t take_header(char* data, std::size_t size, std::size_t count, void* into) {
  auto& headers = *static_cast<std::map<std::string, std::string>*>(into);
  const std::string_view line(data, size * count);
  const auto colon = line.find(':');
  if (colon == std::string_view::npos || headers.size() > 100) return size * count;
  std::string name(line.substr(0, colon));
  std::ranges::transform(name, name.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c;
  });
  auto value = line.substr(colon + 1);
  const auto first = value.find_first_not_of(" \t"), last = value.find_last_not_of(" \t\r\n");
  headers[name] =
      first == std::string_view::npos ? "" : std::string(value.substr(first, last - first + 1));
  return size * count;
}

struct HeaderList {
  curl_slist* list = nullptr;
  ~HeaderList() { curl_slist_free_all(list); }
  void add(const std::string& line) { list = curl_slist_append(list, line.c_str()); }
};

std::string variable(const char* name) {
  const char* text = std::getenv(name);
  return text == nullptr ? "" : text;
}

}  // namespace

struct S3Client::Curl {
  CURL* handle = curl_easy_init();
  ~Curl() {
    if (handle != nullptr) curl_easy_cleanup(handle);
  }
};

Result<Credentials> credentials_of_environment() {
  Credentials credentials{.key_id = variable("AWS_ACCESS_KEY_ID"),
                          .secret = variable("AWS_SECRET_ACCESS_KEY"),
                          .session_token = variable("AWS_SESSION_TOKEN")};
  for (const auto& [name, text] : {std::pair{"AWS_ACCESS_KEY_ID", &credentials.key_id},
                                   {"AWS_SECRET_ACCESS_KEY", &credentials.secret}})
    if (text->empty())
      return Error{ErrorCode::Usage, fmt::format("{}: is not set: storage wants a key", name)};
  for (const auto* text : {&credentials.key_id, &credentials.secret, &credentials.session_token})
    if (!is_printable(*text))
      return Error{ErrorCode::Usage, "AWS_...: the keys in the environment are no plain text"};
  return credentials;
}

Result<Place> read_place(const std::string& url, const std::string& endpoint, bool allows_plain) {
  constexpr std::string_view kScheme = "s3://";
  if (!url.starts_with(kScheme))
    return Error{ErrorCode::Usage, url + ": is not of the form s3://bucket/prefix"};
  Place place{.endpoint = endpoint, .bucket = {}, .prefix = {}, .allows_plain = allows_plain};
  const auto rest = url.substr(kScheme.size());
  const auto slash = rest.find('/');
  place.bucket = rest.substr(0, slash);
  if (slash != std::string::npos) place.prefix = rest.substr(slash + 1);
  while (place.prefix.ends_with('/')) place.prefix.pop_back();
  const bool is_bucket =
      place.bucket.size() >= 3 && place.bucket.size() <= 63 &&
      place.bucket.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789.-") == std::string::npos;
  if (!is_bucket)
    return Error{ErrorCode::Usage,
                 url + ": a bucket has 3 to 63 of the characters a to z, 0 to 9, . and -"};
  if (place.prefix.size() > 512 || printable(place.prefix) != place.prefix ||
      place.prefix.starts_with('/'))
    return Error{ErrorCode::Usage, url + ": the prefix has 512 characters at most, and no / first"};
  while (place.endpoint.ends_with('/')) place.endpoint.pop_back();
  const bool is_tls = place.endpoint.starts_with("https://");
  const bool is_plain = place.endpoint.starts_with("http://");
  const auto host_port =
      place.endpoint.substr(std::min(place.endpoint.size(), std::size_t{is_tls ? 8u : 7u}));
  if ((!is_tls && !is_plain) || host_port.empty() ||
      host_port.find_first_of("/@?# ") != std::string::npos)
    return Error{ErrorCode::Usage,
                 endpoint + ": is not of the form https://host or https://host:port"};
  const auto host = host_port.starts_with('[') ? host_port.substr(0, host_port.find(']') + 1)
                                               : host_port.substr(0, host_port.find(':'));
  if (is_plain && !allows_plain && !is_this_machine(host))
    return Error{ErrorCode::Usage, endpoint +
                                       ": is another machine without TLS, where recordings can be "
                                       "read on their way: use https://, or give --plain-http"};
  return place;
}

Result<std::unique_ptr<S3Client>> S3Client::create(Place place, Credentials credentials) {
  static const auto kReady = curl_global_init(CURL_GLOBAL_DEFAULT);
  auto curl = std::make_unique<Curl>();
  if (kReady != CURLE_OK || curl->handle == nullptr)
    return Error{ErrorCode::ResourceMissing, "libcurl cannot be used"};
  return std::unique_ptr<S3Client>(
      new S3Client(std::move(place), std::move(credentials), std::move(curl)));
}

S3Client::S3Client(Place place, Credentials credentials, std::unique_ptr<Curl> curl)
    : place_(std::move(place)), credentials_(std::move(credentials)), curl_(std::move(curl)) {}

S3Client::~S3Client() = default;

Result<Answer> S3Client::ask(const Request& request) {
  for (int attempt = 1;; ++attempt) {
    auto answer = ask_once(request);
    const bool is_passing = !answer || answer->status >= 500;
    if (!is_passing || attempt == kTries) return answer;
    std::this_thread::sleep_for(std::chrono::seconds(attempt));
  }
}

Result<Answer> S3Client::ask_once(const Request& request) {
  CURL* curl = curl_->handle;
  curl_easy_reset(curl);
  std::string url = place_.endpoint + "/" + place_.bucket;
  if (!request.key.empty()) url += "/" + encoded(request.key, true);
  char separator = '?';
  for (const auto& [name, value] : request.query) {
    url += separator + encoded(name, false) + "=" + encoded(value, false);
    separator = '&';
  }
  Answer answer;
  HeaderList headers;
  headers.add("x-amz-content-sha256: " + secure::to_hex(secure::sha256(request.body)));
  if (!credentials_.session_token.empty())
    headers.add("x-amz-security-token: " + credentials_.session_token);
  for (const auto& [name, value] : request.headers) headers.add(name + ": " + value);
  // Without it libcurl names a form, after it has signed. It signs what a line takes out, too.
  headers.add("Content-Type: application/octet-stream");
  const auto signature = "aws:amz:" + place_.region + ":s3";
  const auto user = credentials_.key_id + ":" + credentials_.secret;
  const bool is_head = std::string_view(request.method) == "HEAD";
  const bool has_body =
      std::string_view(request.method) == "PUT" || std::string_view(request.method) == "POST";
  curl_easy_setopt(curl, CURLOPT_URL, url.c_str());
  curl_easy_setopt(curl, CURLOPT_PATH_AS_IS, 1L);
  curl_easy_setopt(curl, CURLOPT_PROTOCOLS_STR, "http,https");
  curl_easy_setopt(curl, CURLOPT_NOSIGNAL, 1L);
  curl_easy_setopt(curl, CURLOPT_CONNECTTIMEOUT, kConnectSeconds);
  curl_easy_setopt(curl, CURLOPT_LOW_SPEED_LIMIT, 1L);
  curl_easy_setopt(curl, CURLOPT_LOW_SPEED_TIME, kStillSeconds);
  curl_easy_setopt(curl, CURLOPT_AWS_SIGV4, signature.c_str());
  curl_easy_setopt(curl, CURLOPT_USERPWD, user.c_str());
  curl_easy_setopt(curl, CURLOPT_HTTPHEADER, headers.list);
  curl_easy_setopt(curl, CURLOPT_WRITEFUNCTION, take_body);
  curl_easy_setopt(curl, CURLOPT_WRITEDATA, &answer.body);
  curl_easy_setopt(curl, CURLOPT_HEADERFUNCTION, take_header);
  curl_easy_setopt(curl, CURLOPT_HEADERDATA, &answer.headers);
  if (is_head) curl_easy_setopt(curl, CURLOPT_NOBODY, 1L);
  if (has_body) {
    curl_easy_setopt(curl, CURLOPT_POSTFIELDSIZE_LARGE,
                     static_cast<curl_off_t>(request.body.size()));
    curl_easy_setopt(
        curl, CURLOPT_POSTFIELDS,
        request.body.empty() ? "" : reinterpret_cast<const char*>(request.body.data()));
  }
  if (!is_head) curl_easy_setopt(curl, CURLOPT_CUSTOMREQUEST, request.method);
  const auto code = curl_easy_perform(curl);
  if (code != CURLE_OK)
    return Error{ErrorCode::ResourceMissing,
                 fmt::format("{}: {}", place_.endpoint, curl_easy_strerror(code))};
  curl_easy_getinfo(curl, CURLINFO_RESPONSE_CODE, &answer.status);
  return answer;
}

Error S3Client::refusal(const Request& request, const Answer& answer) const {
  std::size_t from = 0;
  const auto code = element_text(answer.body, "Code", from);
  from = 0;
  const auto message = element_text(answer.body, "Message", from);
  // An answer to HEAD has no words, and storage says little to those whom it does not know.
  const bool is_stranger = answer.status == 401 || answer.status == 403;
  const bool is_elsewhere =
      answer.status == 301 || answer.status == 307 || (answer.status == 400 && code.empty());
  const auto advice =
      is_stranger || is_elsewhere
          ? fmt::format(
                "; check AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, the region {} "
                "(--region), and that the keys may use the bucket {}",
                place_.region, place_.bucket)
          : std::string();
  return {
      ErrorCode::Refused,
      fmt::format("{}/{}/{}: {} is answered with {}{}{}", place_.endpoint, place_.bucket,
                  request.key, request.method, answer.status,
                  code.empty() ? "" : printable(" " + code + ": " + message, kMostReason), advice)};
}

std::string element_text(const std::string& xml, const std::string& name, std::size_t& from) {
  const auto opening = "<" + name + ">", closing = "</" + name + ">";
  const auto begin = xml.find(opening, from);
  if (begin == std::string::npos) return {};
  const auto end = xml.find(closing, begin);
  if (end == std::string::npos) return {};
  from = end + closing.size();
  auto text = xml.substr(begin + opening.size(), end - begin - opening.size());
  for (const auto& [entity, character] :
       {std::pair{"&quot;", "\""}, {"&#34;", "\""}, {"&lt;", "<"}, {"&gt;", ">"}, {"&amp;", "&"}})
    for (auto at = text.find(entity); at != std::string::npos; at = text.find(entity, at + 1))
      text.replace(at, std::string_view(entity).size(), character);
  return text;
}

}  // namespace trocar::archive
