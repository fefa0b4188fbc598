#pragma once

// Many short lists that grow and shrink, each contiguous, in few allocations: the rows of groups,
// the elements at nodes.
//
// Built one after another without gaps (until end_building()), as fast to run through as one array.
// After that a block that outgrows its capacity moves to a freed place of its size or to a new
// chunk, with an eighth to grow into; the others stay where they are. Blocks far from their
// neighbours are slow to run through, so once a quarter has moved, or more than half of the memory
// is unused, tidy() copies all of them into a new chunk in order, some at each call, and frees the
// old ones after the last. Where a block lies changes no result. Spans are valid until the block is
// resized or tidy() is called. One writer.

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <new>
#include <span>
#include <type_traits>
#include <vector>

namespace trocar {

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
      relocate(block, size);
      if (!is_building_) scattered_ += size;
    }
    std::fill(block.data + std::min(block.size, size), block.data + size, T{});
    live_ = live_ + size - block.size;
    block.size = size;
    return {block.data, size};
  }

  // To be called after changes, and at best also when there are none; copies at most kTidyBytes.
  void tidy() {
    if (!is_tidying()) {
      const bool is_wasteful = capacity_ - live_ > std::max(capacity_ / 2, 4 * kChunk);
      if (scattered_ <= std::max(live_ / 4, kChunk) && !is_wasteful) return;
      begin_tidying();
    }
    for (std::size_t copied = 0; copied * sizeof(T) < kTidyBytes; ++cursor_) {
      if (cursor_ == blocks_.size()) return end_tidying();
      Block& block = blocks_[cursor_];
      copied += block.size + 1;
      if (block.size > 0)
        relocate(block, block.size);
      else
        block = {};
    }
  }

  // Elements in blocks, and what there is memory for.
  std::size_t live() const { return live_; }
  std::size_t capacity() const { return capacity_; }

 private:
  struct Block {
    T* data = nullptr;
    std::uint32_t size = 0, capacity = 0;
  };
  struct Free {
    void operator()(T* data) const { ::operator delete (data, std::align_val_t{alignof(T)}); }
  };
  // Memory that costs nothing until it is used.
  struct Chunk {
    std::unique_ptr<T, Free> data;
    std::size_t size = 0;
  };
  static_assert(std::is_trivially_copyable_v<T>);
  // Capacities after building are multiples of this, so that freed places fit again.
  static constexpr std::uint32_t kGrain = 4;
  static constexpr std::size_t kClasses = 64;
  static constexpr std::size_t kChunk = std::max(std::size_t{64}, 65536 / sizeof(T));
  static constexpr std::size_t kTidyBytes = 131072;

  void add_chunk(std::size_t elements) {
    auto* const data =
        static_cast<T*>(::operator new (elements * sizeof(T), std::align_val_t{alignof(T)}));
    chunks_.push_back({std::unique_ptr<T, Free>(data), elements});
    next_ = data;
    left_ = elements;
    capacity_ += elements;
  }

  Block allocate(std::uint32_t size) {
    const auto grains = (size + size / 8 + kGrain - 1) / kGrain;
    const auto capacity = is_building_ ? size : grains * kGrain;
    // While tidying new places are taken in order.
    if (!is_building_ && !is_tidying() && grains < kClasses && !free_[grains].empty()) {
      T* const data = free_[grains].back();
      free_[grains].pop_back();
      return {data, 0, capacity};
    }
    if (left_ < capacity) {
      // The rest of the chunk is a place like a freed one.
      if (left_ > 0) release({next_, 0, static_cast<std::uint32_t>(std::min(left_, kMostLeft))});
      add_chunk(std::max(std::size_t{capacity}, kChunk));
    }
    const Block block{next_, 0, capacity};
    next_ += capacity;
    left_ -= capacity;
    return block;
  }
  static constexpr std::size_t kMostLeft = kGrain * kClasses - 1;

  // Places in chunks that are about to be freed are not kept.
  void release(const Block& block) {
    const auto grains = block.capacity / kGrain;
    if (grains > 0 && grains < kClasses && !is_tidying()) free_[grains].push_back(block.data);
  }

  void relocate(Block& block, std::uint32_t size) {
    Block moved = allocate(size);
    std::copy_n(block.data, block.size, moved.data);
    release(block);
    moved.size = block.size;
    block = moved;
  }

  bool is_tidying() const { return !old_chunks_.empty(); }
  void begin_tidying() {
    old_chunks_.swap(chunks_);
    for (auto& places : free_) places.clear();
    cursor_ = 0;
    scattered_ = 0;
    left_ = 0;
    add_chunk(live_ + live_ / 4 + kChunk);
  }
  void end_tidying() {
    for (const Chunk& chunk : old_chunks_) capacity_ -= chunk.size;
    old_chunks_.clear();
  }

  std::vector<Block> blocks_;
  std::vector<Chunk> chunks_, old_chunks_;      // old: blocks from cursor_ on are in them
  std::array<std::vector<T*>, kClasses> free_;  // by capacity in grains
  T* next_ = nullptr;                           // in the last chunk
  std::size_t left_ = 0;
  std::size_t live_ = 0, capacity_ = 0, scattered_ = 0;
  std::size_t cursor_ = 0;
  bool is_building_ = true;
};

}  // namespace trocar
