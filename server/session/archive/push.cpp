#include "server/session/archive/push.h"

#include <fmt/format.h>
#include <openssl/evp.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "common/base/bytes.h"
#include "common/secure/digest.h"

namespace trocar::archive {
namespace {

namespace fs = std::filesystem;

// A part that no object gets: it says of which file an upload is. It comes after all others.
constexpr std::size_t kMarkPart = kMostParts + 1;
constexpr long kOk = 200, kNoContent = 204, kNotFound = 404, kThereAlready = 412;
// The storage takes nothing in place of what another program has brought meanwhile.
const Fields::value_type kOnlyNew{"if-none-match", "*"};

class Hash {
 public:
  explicit Hash(const EVP_MD* kind) : context_(EVP_MD_CTX_new(), EVP_MD_CTX_free) {
    EVP_DigestInit_ex(context_.get(), kind, nullptr);
  }
  void add(BytesView bytes) { EVP_DigestUpdate(context_.get(), bytes.data(), bytes.size()); }
  std::string hex() {
    Bytes digest(EVP_MAX_MD_SIZE);
    unsigned size = 0;
    EVP_DigestFinal_ex(context_.get(), digest.data(), &size);
    return secure::to_hex(BytesView(digest).first(size));
  }

 private:
  std::unique_ptr<EVP_MD_CTX, void (*)(EVP_MD_CTX*)> context_;
};

std::string md5_of(BytesView bytes) {
  Hash md5(EVP_md5());
  md5.add(bytes);
  return md5.hex();
}

// A file as parts of one size, the last of which is shorter.
class PartedFile {
 public:
  static Result<PartedFile> open(const std::string& path, std::uint64_t part_bytes) {
    std::error_code failed;
    const auto size = fs::file_size(path, failed);
    if (failed) return Error{ErrorCode::ResourceMissing, path + ": " + failed.message()};
    PartedFile file(path, size, part_bytes);
    if (auto read = file.hash(); !read) return read.error();
    return file;
  }

  std::uint64_t size() const { return size_; }
  std::size_t count() const { return md5_.size(); }
  const std::string& md5(std::size_t part) const { return md5_[part]; }
  const std::string& sha256() const { return sha256_; }
  std::uint64_t size_of(std::size_t part) const {
    return std::min(part_bytes_, size_ - part * part_bytes_);
  }
  // Error: it is not there, or is another one than it was.
  Result<Bytes> read(std::size_t part) const {
    Bytes bytes(size_of(part));
    std::ifstream in(path_, std::ios::binary);
    in.seekg(static_cast<std::streamoff>(part * part_bytes_));
    in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    if (!in) return changed();
    if (!md5_[part].empty() && md5_of(bytes) != md5_[part]) return changed();
    return bytes;
  }

 private:
  PartedFile(std::string path, std::uint64_t size, std::uint64_t part_bytes)
      : path_(std::move(path)),
        size_(size),
        part_bytes_(std::max(part_bytes, (size + kMostParts - 1) / kMostParts)) {
    md5_.resize(std::max<std::size_t>(1, (size_ + part_bytes_ - 1) / part_bytes_));
  }
  Error changed() const { return {ErrorCode::BadFile, path_ + ": has changed while it was read"}; }
  Status hash() {
    Hash whole(EVP_sha256());
    for (std::size_t part = 0; part < count(); ++part) {
      const auto bytes = read(part);
      if (!bytes) return bytes.error();
      md5_[part] = md5_of(*bytes);
      whole.add(*bytes);
    }
    sha256_ = whole.hex();
    return {};
  }

  std::string path_;
  std::uint64_t size_, part_bytes_;
  std::vector<std::string> md5_;
  std::string sha256_;
};

class Push {
 public:
  Push(S3Client& client, const PartedFile& file, std::string key, const PushOptions& options)
      : client_(client), file_(file), key_(std::move(key)), options_(options) {
    report_.bytes = file.size();
    report_.sha256 = file.sha256();
  }

  Result<PushReport> run() {
    const auto there = is_there();
    if (!there) return there.error();
    if ((report_.was_there = *there)) return report_;
    if (auto sent = file_.count() == 1 ? send_whole() : send_parts(); !sent) return sent.error();
    const auto arrived = is_there();
    if (!arrived) return arrived.error();
    if (*arrived) return report_;
    return Error{ErrorCode::Mismatch, key_ + ": is not there, although it was taken"};
  }

 private:
  Result<Answer> ask(const Request& request, long expected = kOk) {
    auto answer = client_.ask(request);
    if (answer && answer->status != expected) return client_.refusal(request, *answer);
    return answer;
  }

  // Whether the storage has it. Error: it has something else.
  Result<bool> is_there() {
    const Request question{.method = "HEAD", .key = key_};
    const auto answer = client_.ask(question);
    if (!answer) return answer.error();
    if (answer->status == kNotFound) return false;
    if (answer->status != kOk) return client_.refusal(question, *answer);
    const auto value = [&](const char* name) {
      const auto found = answer->headers.find(name);
      return found == answer->headers.end() ? std::string() : found->second;
    };
    if (value("content-length") == std::to_string(file_.size()) &&
        value(kChecksumHeader) == file_.sha256())
      return true;
    return Error{ErrorCode::Refused,
                 key_ + ": is there with other content, nothing is ever replaced"};
  }

  Status send_whole() {
    const auto bytes = file_.read(0);
    if (!bytes) return bytes.error();
    const Request request{.method = "PUT",
                          .key = key_,
                          .headers = {kOnlyNew, {kChecksumHeader, file_.sha256()}},
                          .body = *bytes};
    const auto taken = store(request);
    if (!taken) return taken.error();
    report_.parts_sent += *taken;
    return {};
  }

  // Asks for what makes an object. False: another program made one of that name meanwhile.
  Result<bool> store(const Request& request) {
    const auto answer = client_.ask(request);
    if (!answer) return answer.error();
    if (answer->status == kThereAlready) {
      report_.was_there = true;  // with what content, the last question says
      return false;
    }
    // The storage may find that something is wrong when it has answered already.
    if (answer->status != kOk || answer->body.find("<Error>") != std::string::npos)
      return client_.refusal(request, *answer);
    return true;
  }

  Status send_parts() {
    auto upload = unfinished_upload();
    if (!upload) return upload.error();
    std::map<std::size_t, std::string> there;  // tags of parts, by number from 0
    if (!upload->empty()) {
      const auto is_ours = list_parts(*upload, there);
      if (!is_ours) return is_ours.error();
      if (!*is_ours) {
        // It is or may be of another file, and would get the checksum of that.
        if (auto dropped = drop_upload(*upload); !dropped) return dropped;
        there.clear();
        upload->clear();
      }
    }
    if (upload->empty()) {
      if (upload = begin_upload(); !upload) return upload.error();
      const auto& sha256 = file_.sha256();
      const auto marked = send_part(*upload, kMarkPart, bytes_of(std::string_view(sha256)));
      if (!marked) return marked.error();
    }
    std::string parts;
    for (std::size_t part = 0; part < file_.count(); ++part) {
      auto& tag = there[part];
      if (!tag.empty()) {
        ++report_.parts_there;
      } else {
        const auto bytes = file_.read(part);
        if (!bytes) return bytes.error();
        auto sent = send_part(*upload, part + 1, *bytes);
        if (!sent) return sent.error();
        tag = std::move(*sent);
        ++report_.parts_sent;
      }
      parts +=
          fmt::format("<Part><PartNumber>{}</PartNumber><ETag>{}</ETag></Part>", part + 1, tag);
      if (options_.progress) options_.progress(part + 1, file_.count());
    }
    const auto body =
        "<CompleteMultipartUpload xmlns=\"http://s3.amazonaws.com/doc/2006-03-01/\">" + parts +
        "</CompleteMultipartUpload>";
    const Request last{.method = "POST",
                       .key = key_,
                       .query = {{"uploadId", *upload}},
                       .headers = {kOnlyNew},
                       .body = bytes_of(std::string_view(body))};
    const auto taken = store(last);
    if (!taken) return taken.error();
    return *taken ? Status() : drop_upload(*upload);
  }

  // One that is no longer there is no error.
  Status drop_upload(const std::string& upload) {
    const Request request{.method = "DELETE", .key = key_, .query = {{"uploadId", upload}}};
    const auto answer = client_.ask(request);
    if (!answer) return answer.error();
    if (answer->status == kOk || answer->status == kNoContent || answer->status == kNotFound)
      return {};
    return client_.refusal(request, *answer);
  }

  // The newest that was begun for this object; empty if there is none.
  Result<std::string> unfinished_upload() {
    const auto answer = ask({.key = {}, .query = {{"prefix", key_}, {"uploads", ""}}});
    if (!answer) return answer.error();
    std::string newest;
    std::size_t from = 0;
    for (;;) {
      const auto entry = element_text(answer->body, "Upload", from);
      if (entry.empty()) return newest;
      std::size_t at = 0;
      if (element_text(entry, "Key", at) != key_) continue;
      at = 0;
      newest = element_text(entry, "UploadId", at);
    }
  }

  Result<std::string> begin_upload() {
    const Request request{.method = "POST",
                          .key = key_,
                          .query = {{"uploads", ""}},
                          .headers = {{kChecksumHeader, file_.sha256()}}};
    const auto answer = ask(request);
    if (!answer) return answer.error();
    std::size_t from = 0;
    const auto id = element_text(answer->body, "UploadId", from);
    if (id.empty()) return client_.refusal(request, *answer);
    return id;
  }

  // Fills in the tags of the parts that are there. False: the upload is not marked as one of this
  // file, or a part is not of it. Files may share parts, so that parts alone do not tell.
  Result<bool> list_parts(const std::string& upload, std::map<std::size_t, std::string>& there) {
    const auto answer = ask({.key = key_, .query = {{"uploadId", upload}}});
    if (!answer) return answer.error();
    bool is_marked = false;
    std::size_t from = 0;
    for (;;) {
      const auto entry = element_text(answer->body, "Part", from);
      if (entry.empty()) return is_marked;
      const auto text = [&entry](const char* name) {
        std::size_t at = 0;
        return element_text(entry, name, at);
      };
      const auto number = text("PartNumber");
      const auto tag = text("ETag");
      if (number == std::to_string(kMarkPart)) {
        is_marked = tag == '"' + md5_of(bytes_of(std::string_view(file_.sha256()))) + '"';
        continue;
      }
      std::size_t part = 0;
      while (part < file_.count() && number != std::to_string(part + 1)) ++part;
      if (part == file_.count() || text("Size") != std::to_string(file_.size_of(part)) ||
          tag != '"' + file_.md5(part) + '"')
        return false;
      there[part] = tag;
    }
  }

  // Returns the part's tag.
  Result<std::string> send_part(const std::string& upload, std::size_t number, BytesView bytes) {
    const Request request{.method = "PUT",
                          .key = key_,
                          .query = {{"partNumber", std::to_string(number)}, {"uploadId", upload}},
                          .body = bytes};
    const auto answer = ask(request);
    if (!answer) return answer.error();
    const auto found = answer->headers.find("etag");
    if (found == answer->headers.end()) return client_.refusal(request, *answer);
    return found->second;
  }

  S3Client& client_;
  const PartedFile& file_;
  const std::string key_;
  const PushOptions& options_;
  PushReport report_;
};

}  // namespace

std::string object_key(const std::string& prefix, const std::string& path) {
  return prefix.empty() ? path : prefix + "/" + path;
}

Result<PushReport> push_file(S3Client& client, const std::string& file, const std::string& key,
                             const PushOptions& options) {
  if (key.size() > 1024)
    return Error{ErrorCode::Usage, key + ": is longer than the 1024 bytes that a name may have"};
  const auto parted = PartedFile::open(file, options.part_bytes);
  if (!parted) return parted.error();
  return Push(client, *parted, key, options).run();
}

}  // namespace trocar::archive
