#pragma once

// Many short lists that grow and shrink, each contiguous, in few allocations: the rows of groups,
// the elements at nodes.
//
// Built one after another without gaps (until end_building()), as fast to run through as one array.
// After that a block that outgrows its capacity moves to a freed place of its size or to a new
// chunk; the others stay where they are. tidy() packs everything anew once more than half of the
// memory is unused. Where a block lies changes no result. Spans are valid until the block is
// resized or tidy() is called. One writer.

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "common/base/assert.h"

namespace trocar::dynamics {

template <typename T>
class Blocks {
 public:
  std::size_t count() const { return blocks_.size(); }
  std::span<const T> operator[](std::size_t block) const {
    return {blocks_[block].data, blocks_[block].size};
  }
  std::span<T> operator[](std::size_t block) { return {blocks_[block].data, blocks_[block].size}; }

  // At least so many blocks; new ones are empty.
  void extend(std::size_t count) {
    if (count > blocks_.size()) blocks_.resize(count);
  }
  // Room for so many elements in one allocation: before the first block gets any.
  void reserve(std::size_t elements) { add_chunk(elements); }
  void end_building() { is_building_ = false; }

  // Keeps the elements up to `size`; new ones are T{}.
  std::span<T> resize(std::size_t index, std::uint32_t size) {
    Block& block = blocks_[index];
    if (size > block.capacity) {
      Block moved = allocate(size);
      std::copy_n(block.data, block.size, moved.data);
      release(block);
      moved.size = block.size;
      block = moved;
    }
    std::fill(block.data + std::min(block.size, size), block.data + size, T{});
    live_ = live_ + size - block.size;
    block.size = size;
    return {block.data, size};
  }

  void tidy() {
    if (capacity() - live_ > std::max(capacity() / 2, 4 * kChunk)) pack();
  }

  // Elements in blocks, and what there is memory for.
  std::size_t live() const { return live_; }
  std::size_t capacity() const { return capacity_; }

 private:
  struct Block {
    T* data = nullptr;
    std::uint32_t size = 0, capacity = 0;
  };
  // Capacities after building are multiples of this, so that freed places fit again.
  static constexpr std::uint32_t kGrain = 4;
  static constexpr std::size_t kClasses = 64;
  static constexpr std::size_t kChunk = std::max(std::size_t{64}, 65536 / sizeof(T));

  void add_chunk(std::size_t elements) {
    chunks_.push_back(std::make_unique<T[]>(elements));
    next_ = chunks_.back().get();
    left_ = elements;
    capacity_ += elements;
  }

  Block allocate(std::uint32_t size) {
    const auto grains = (size + kGrain - 1) / kGrain;
    const auto capacity = is_building_ ? size : grains * kGrain;
    if (!is_building_ && grains < kClasses && !free_[grains].empty()) {
      T* const data = free_[grains].back();
      free_[grains].pop_back();
      return {data, 0, capacity};
    }
    if (left_ < capacity) {
      // What is left of the chunk is a place like a freed one.
      if (left_ > 0) release({next_, 0, static_cast<std::uint32_t>(std::min(left_, kMostLeft))});
      add_chunk(std::max(std::size_t{capacity}, kChunk));
    }
    const Block block{next_, 0, capacity};
    next_ += capacity;
    left_ -= capacity;
    return block;
  }
  static constexpr std::size_t kMostLeft = kGrain * kClasses - 1;

  void release(const Block& block) {
    const auto grains = block.capacity / kGrain;
    if (grains > 0 && grains < kClasses) free_[grains].push_back(block.data);
  }

  void pack() {
    std::vector<std::unique_ptr<T[]>> old;
    old.swap(chunks_);
    capacity_ = 0;
    for (auto& places : free_) places.clear();
    add_chunk(live_ + live_ / 8 + 1);
    for (Block& block : blocks_) {
      T* const data = next_;
      std::copy_n(block.data, block.size, data);
      next_ += block.size;
      left_ -= block.size;
      block = {data, block.size, block.size};
    }
  }

  std::vector<Block> blocks_;
  std::vector<std::unique_ptr<T[]>> chunks_;
  std::array<std::vector<T*>, kClasses> free_;  // by capacity in grains
  T* next_ = nullptr;                           // in the last chunk
  std::size_t left_ = 0;
  std::size_t live_ = 0, capacity_ = 0;
  bool is_building_ = true;
};

}  // namespace trocar::dynamics
