#pragma once

// The files of the page, read once: what is not among them does not exist, whatever path a browser
// asks for. A file with a compressed twin (NAME.gz) is sent that way to who takes it.

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "common/base/bytes.h"
#include "common/base/result.h"

namespace trocar::site {

struct PageFile {
  std::string type;   // of its content
  std::string etag;   // with its quotes
  Bytes plain, gzip;  // the second may be empty
};

class PageFiles {
 public:
  // Reads the folder, at most 64 files of 16 MiB, without those below it. An error names what is
  // missing: the page is index.html at least.
  static Result<PageFiles> read(const std::filesystem::path& folder);

  // `path`: of a request, "/" for the page itself. Null: there is no such file.
  const PageFile* find(std::string_view path) const;
  std::size_t bytes() const;

 private:
  std::map<std::string, PageFile, std::less<>> files_;
};

}  // namespace trocar::site
