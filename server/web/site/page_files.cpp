#include "server/web/site/page_files.h"

#include <array>
#include <fstream>
#include <iterator>

#include "common/base/checksum.h"
#include "common/base/json.h"

namespace trocar::site {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostFiles = 64;
constexpr std::uintmax_t kMostBytes = 16u << 20;

struct Kind {
  const char *ending, *type;
};
constexpr std::array kKinds{Kind{".html", "text/html; charset=utf-8"},
                            Kind{".js", "text/javascript; charset=utf-8"},
                            Kind{".css", "text/css; charset=utf-8"},
                            Kind{".wasm", "application/wasm"},
                            Kind{".svg", "image/svg+xml"},
                            Kind{".png", "image/png"},
                            Kind{".txt", "text/plain; charset=utf-8"}};

const char* type_of(const std::string& name) {
  for (const auto& kind : kKinds)
    if (name.ends_with(kind.ending)) return kind.type;
  return nullptr;
}

Result<Bytes> read_file(const fs::path& path) {
  std::error_code error;
  const auto size = fs::file_size(path, error);
  std::ifstream file(path, std::ios::binary);
  if (error || !file || size > kMostBytes)
    return Error{ErrorCode::BadFile, path.string() + ": cannot be read, or is over 16 MiB"};
  Bytes bytes{std::istreambuf_iterator<char>(file), {}};
  return bytes;
}

}  // namespace

Result<PageFiles> PageFiles::read(const fs::path& folder) {
  PageFiles page;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const auto name = it->path().filename().string();
    const char* type = type_of(name);
    std::error_code ignored;
    if (type == nullptr || !it->is_regular_file(ignored)) continue;
    if (page.files_.size() >= kMostFiles)
      return Error{ErrorCode::BadFile, folder.string() + ": has over 64 files: is it the page's?"};
    auto plain = read_file(it->path());
    if (!plain) return plain.error();
    PageFile file;
    file.type = type;
    file.etag = '"' + hex64(xxh3_64(*plain)) + '"';
    file.plain = std::move(*plain);
    if (const auto packed = fs::path(it->path().string() + ".gz"); fs::exists(packed, ignored)) {
      auto gzip = read_file(packed);
      if (!gzip) return gzip.error();
      file.gzip = std::move(*gzip);
    }
    page.files_.emplace("/" + name, std::move(file));
  }
  if (page.files_.contains("/index.html")) return page;
  return Error{ErrorCode::ResourceMissing,
               folder.string() +
                   ": has no page in it: build it (deploy/setup --with-web, then deploy/build), or "
                   "name its folder with --page"};
}

const PageFile* PageFiles::find(std::string_view path) const {
  const auto found = files_.find(path == "/" ? std::string_view("/index.html") : path);
  return found == files_.end() ? nullptr : &found->second;
}

std::size_t PageFiles::bytes() const {
  std::size_t sum = 0;
  for (const auto& [name, file] : files_) sum += file.plain.size() + file.gzip.size();
  return sum;
}

}  // namespace trocar::site
