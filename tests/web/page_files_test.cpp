#include "server/web/site/page_files.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>

namespace trocar::site {
namespace {

namespace fs = std::filesystem;

class PageFilesTest : public ::testing::Test {
 protected:
  PageFilesTest() { fs::create_directories(folder_); }
  ~PageFilesTest() override { fs::remove_all(folder_); }

  void write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
  }

  const fs::path folder_ =
      fs::temp_directory_path() / ("trocar-page-" + std::to_string(::getpid()));
};

TEST_F(PageFilesTest, AreFoundByTheirPathAlone) {
  write("index.html", "<html>");
  write("replica.wasm", "wasm");
  write("replica.wasm.gz", "packed");
  write("notes.bak", "no file of a page");
  const auto page = PageFiles::read(folder_);
  ASSERT_TRUE(page.ok());
  ASSERT_NE(page->find("/"), nullptr);
  EXPECT_EQ(page->find("/"), page->find("/index.html"));
  const auto* module = page->find("/replica.wasm");
  ASSERT_NE(module, nullptr);
  EXPECT_EQ(module->type, "application/wasm");
  EXPECT_EQ(module->gzip.size(), 6u);
  for (const auto* path :
       {"", "index.html", "/notes.bak", "/replica.wasm.gz", "/../index.html", "//index.html",
        "/./index.html", "/index.html/", "/%69ndex.html", "/etc/passwd"})
    EXPECT_EQ(page->find(path), nullptr) << path;
}

TEST_F(PageFilesTest, AFolderWithoutAPageIsAnError) {
  const auto page = PageFiles::read(folder_);
  ASSERT_FALSE(page.ok());
  EXPECT_NE(page.error().message.find("has no page in it"), std::string::npos);
  EXPECT_FALSE(PageFiles::read(folder_ / "none").ok());
}

}  // namespace
}  // namespace trocar::site
