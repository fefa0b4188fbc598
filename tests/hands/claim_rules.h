#pragma once

// The rules of ownership as a watch over a ClaimTable: after each update it names the first rule
// that is broken. docs/ownership-model.md has the same rules as properties of a model.

#include <array>
#include <span>
#include <string>
#include <vector>

#include "server/tissue/hands/claims.h"

namespace trocar::hands::testing {

class ClaimRules {
 public:
  // tool_count: of all hands together.
  ClaimRules(const ClaimTable& table, int tool_count) : tool_count_(tool_count) { remember(table); }

  // After the update of `tick` with these requests, which told of `events`. Empty: nothing is
  // broken.
  std::string check(Tick tick, const ClaimTable& table, std::size_t node_count,
                    std::span<const ClaimRequest> requests, std::span<const ClaimEvent> events);

  // How often others were granted a waiting grasp's only node: the most, over all waits.
  int most_overtaken() const { return most_overtaken_; }

 private:
  struct Wait {
    NodeIndex node;  // invalid: the tool does not wait for a single node
    Tick since = 0;
    int overtaken = 0;
  };

  std::string check_owners(const ClaimTable& table, std::size_t node_count) const;
  std::string check_tool(Tick tick, const ClaimTable& table, ToolSlot tool,
                         const ClaimRequest* request, std::span<const ClaimRequest> requests) const;
  std::string count_overtaking(Tick tick, const ClaimTable& table,
                               std::span<const ClaimRequest> requests,
                               std::span<const ClaimEvent> events);
  void remember(const ClaimTable& table);

  const int tool_count_;
  std::array<Claim, kMaxTools> before_;
  std::array<Wait, kMaxTools> waits_;
  int most_overtaken_ = 0;
};

}  // namespace trocar::hands::testing
