#pragma once

// An organ that somebody edits: what is held, of what it is made and where, with undo and redo. The
// mesh stays as it is, and so does all that is not edited, to the bit. After every call the organ
// is one that organ::validate() accepts.
//
// A step is what undo() takes back: one call that changed something, or all calls between
// begin_stroke() and end_stroke() together. The newest kMostSteps steps are kept, and fewer where
// they take more than kMostBytes; older ones stay done.
//
// Cost: a step copies what can be edited, about 8 bytes a node. One thread at a time.

#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "server/organs/material/hyperelastic_material.h"
#include "server/organs/organ/organ.h"

namespace trocar::edit {

inline constexpr std::size_t kMostSteps = 200;
inline constexpr std::size_t kMostBytes = 256u << 20;

// A part of the organ: nothing for its own material, a number for regions[number].
using Part = std::optional<std::size_t>;

class Editor {
 public:
  explicit Editor(organ::Organ organ);

  const organ::Organ& organ() const { return organ_; }
  // It changes with the organ, by undo() and redo() too.
  std::uint64_t version() const { return version_; }

  // Nodes are held, or held no more. `nodes`: of the mesh, in any order. Returns whether any was
  // not so before.
  bool hold(std::span<const NodeIndex> nodes);
  bool release(std::span<const NodeIndex> nodes);

  // A region of these nodes with the organ's own material, after the others: it wins where they
  // overlap. Returns its number. Error: the name is taken or not of 1 to 200 bytes of printable
  // UTF-8, or no element has all of its nodes among these.
  Result<std::size_t> add_region(const std::string& name, std::span<const NodeIndex> nodes);
  // They change nothing where there is no such region. A region without an element of its own left
  // goes away. Returns whether anything changed.
  bool add_to_region(std::size_t region, std::span<const NodeIndex> nodes);
  bool take_from_region(std::size_t region, std::span<const NodeIndex> nodes);
  bool remove_region(std::size_t region);
  // Error: as of add_region()'s names, or there is no such region.
  Status rename_region(std::size_t region, const std::string& name);
  // It comes after the others. Returns whether it did not before.
  bool raise_region(std::size_t region);

  // Density, damping, tension and what the tissue is to blades stay. The strain of all hyperelastic
  // tissue is averaged from then on. Error: the organ has no tets, or there is no such part.
  Status use_measured(Part part, const material::HyperelasticMaterial& measured);
  // Neo-Hookean tissue of this Young's modulus, Pa, and Poisson's ratio.
  Status use_neo_hookean(Part part, double young_modulus_pa, double poisson_ratio);

  void begin_stroke();
  void end_stroke();
  bool can_undo() const { return !past_.empty(); }
  bool can_redo() const { return !future_.empty(); }
  // They end a stroke that is under way. Return false where there is nothing to do.
  bool undo();
  bool redo();

  // Whether the organ differs from what it was at the beginning, or at the last set_saved().
  bool has_unsaved_changes() const { return !(content() == saved_); }
  void set_saved() { saved_ = content(); }

  // How many elements each part has, tets or, without them, springs: [0] the organ's own material,
  // [r + 1] regions[r].
  std::vector<std::size_t> element_counts() const;
  // One line each: what somebody should know before a session.
  std::vector<std::string> remarks() const;

 private:
  // All that can be edited.
  struct Content {
    std::string source;
    material::Material material;
    std::vector<material::MaterialRegion> regions;
    std::vector<NodeIndex> fixed_nodes;
    std::vector<double> node_masses_kg;
    organ::DepthTable depth_table;

    bool operator==(const Content&) const = default;
    std::size_t bytes() const;
  };

  Content content() const;
  void set_content(Content content);
  void remember();
  // Ends a change of the organ: masses follow, a calibration of another organ is dropped, and the
  // source says that it was edited.
  void finish(const std::vector<double>& weights_before);
  // Makes a change and returns true, or leaves all as it was and returns false if the organ is then
  // the same.
  template <typename Change>
  bool change(const Change& make);
  Status check_name(const std::string& name) const;
  Status change_material(Part part, const material::Material& material);
  const material::Material* material_of(Part part) const;

  organ::Organ organ_;
  Content first_, saved_;
  std::deque<Content> past_, future_;
  bool is_in_stroke_ = false, is_stroke_remembered_ = false;
  std::uint64_t version_ = 1;
};

}  // namespace trocar::edit
