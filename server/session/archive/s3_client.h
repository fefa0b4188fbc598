#pragma once

// Requests to storage that speaks Amazon's S3 interface, by libcurl, each signed (AWS Signature
// Version 4) together with the SHA-256 of what it carries. Addresses are path-style:
// ENDPOINT/BUCKET/KEY. One thread.
//
// Bounds: an answer of kMostAnswerBytes, 10 s to connect, and a minute without a byte. What fails
// on the way, or on the other side (5xx), is tried kTries times.

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"

namespace trocar::archive {

struct Credentials {
  std::string key_id, secret;
  std::string session_token;  // empty: none
};

// AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY and AWS_SESSION_TOKEN. Error: one of the first two is
// missing, or none of them is printable.
Result<Credentials> credentials_of_environment();

struct Place {
  std::string endpoint;  // "https://s3.example:9000", without a path
  std::string region = "us-east-1";
  std::string bucket, prefix;  // prefix: without a slash at its ends, may be empty
  bool allows_plain = false;   // http:// to other machines
};

// "s3://bucket/prefix". Error: it is none, or the endpoint is no http(s) address, or one without
// TLS on another machine although that is not allowed.
Result<Place> read_place(const std::string& url, const std::string& endpoint, bool allows_plain);

using Fields = std::vector<std::pair<std::string, std::string>>;

struct Request {
  const char* method = "GET";  // GET, HEAD, PUT, POST or DELETE
  std::string key;             // of the object; empty: the bucket itself
  Fields query;                // in order of their names
  Fields headers;              // lower case
  BytesView body;
};

struct Answer {
  long status = 0;
  std::map<std::string, std::string> headers;  // names in lower case
  std::string body;
};

class S3Client {
 public:
  static constexpr std::size_t kMostAnswerBytes = 4u << 20;
  static constexpr int kTries = 3;

  static Result<std::unique_ptr<S3Client>> create(Place place, Credentials credentials);
  ~S3Client();
  S3Client(const S3Client&) = delete;
  S3Client& operator=(const S3Client&) = delete;

  const Place& place() const { return place_; }
  // Errors: nothing answers. A status of 400 or more is an answer; see refusal().
  Result<Answer> ask(const Request& request);
  // One line about a status that was not expected, with what the storage says of it.
  Error refusal(const Request& request, const Answer& answer) const;

 private:
  struct Curl;
  S3Client(Place place, Credentials credentials, std::unique_ptr<Curl> curl);
  Result<Answer> ask_once(const Request& request);

  Place place_;
  Credentials credentials_;
  std::unique_ptr<Curl> curl_;
};

// The text of the first element of that name after `from`, which moves behind it; empty if there is
// none. Enough for the flat answers of S3.
std::string element_text(const std::string& xml, const std::string& name, std::size_t& from);

}  // namespace trocar::archive
