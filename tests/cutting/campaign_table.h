#pragma once

// Records of a campaign: kept as CSV, a line per cut, so that a campaign may be done in parts and
// go on after an interruption; and what they show, against what has to hold.

#include <filesystem>
#include <map>
#include <tuple>

#include "common/base/result.h"
#include "tests/cutting/campaign.h"

namespace trocar::cutting::testing {

std::string csv_header();
std::string csv_line(const CutRecord& record);

class CampaignTable {
 public:
  // A cut that is there already is replaced: it is the same one.
  void add(const CutRecord& record);
  // Lines that are not whole are left out, as the last one of a part that was stopped may be.
  Status read(const std::filesystem::path& csv);
  bool has_series(const std::string& organ, std::uint64_t number) const;
  std::size_t cuts() const { return records_.size(); }

  // Markdown: what the cuts did, by organ, by kind of cut, by place in the series.
  std::string text() const;
  // Returns what does not hold, a line each; nothing: all laws hold.
  std::vector<std::string> broken_laws() const;

 private:
  std::map<std::tuple<std::string, std::uint64_t, std::uint32_t>, CutRecord> records_;
};

}  // namespace trocar::cutting::testing
