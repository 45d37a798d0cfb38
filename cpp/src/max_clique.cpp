#include <algorithm>
#include <bit>
#include <chrono>
#include <deque>
#include <utility>

#include "prehensile/consensus.h"
#include "vectors.h"

namespace prehensile {
namespace {

using Word = std::uint64_t;

template <typename Visit>
void ForEachBit(const Word* bits, int words, const Visit& visit) {
  for (int w = 0; w < words; ++w) {
    for (Word word = bits[w]; word; word &= word - 1) visit(64 * w + std::countr_zero(word));
  }
}

struct Cores {
  /// The vertices, each of smallest degree among itself and those after it.
  std::vector<int> order;
  /// By vertex: largest k of a subgraph with all degrees at least k that it belongs to.
  std::vector<int> core;
};

/// V. Batagelj and M. Zaveršnik, "An O(m) algorithm for cores decomposition of networks", 2003.
Cores PeelCores(const ConsistencyGraph& graph) {
  const int n = graph.size();
  Cores cores{std::vector<int>(n), std::vector<int>(n)};
  std::vector<int>& degree = cores.core;
  for (int i = 0; i < n; ++i) degree[i] = graph.degree(i);
  std::vector<int> begin(n + 1);  // Where the vertices of each degree begin in the order.
  for (const int d : degree) ++begin[d];
  int sum = 0;
  for (int& b : begin) sum += std::exchange(b, sum);
  std::vector<int> place(n);
  for (int i = 0; i < n; ++i) {
    place[i] = begin[degree[i]]++;
    cores.order[place[i]] = i;
  }
  std::rotate(begin.begin(), begin.end() - 1, begin.end());
  begin[0] = 0;
  for (int k = 0; k < n; ++k) {
    const int v = cores.order[k];
    ForEachBit(graph.row(v), graph.words_per_row(), [&](int u) {
      if (degree[u] <= degree[v]) return;
      // u changes places with the first of its degree and then has one less.
      const int first = begin[degree[u]]++;
      const int w = cores.order[first];
      std::swap(cores.order[first], cores.order[place[u]]);
      std::swap(place[w], place[u]);
      --degree[u];
    });
  }
  return cores;
}

/// The vertices of sufficient core, renumbered, those of the largest core first: of any vertex, at
/// most as many neighbours as its core number come before it.
class CliqueSearch {
 public:
  CliqueSearch(const ConsistencyGraph& graph, const CliqueOptions& options)
      : options_(options), best_size_(std::max(options.min_size, 1) - 1) {
    const Cores cores = PeelCores(graph);
    std::vector<int> number(graph.size(), -1);
    for (auto v = cores.order.rbegin(); v != cores.order.rend(); ++v) {
      if (cores.core[*v] < best_size_) break;  // Core numbers ascend along the order.
      number[*v] = static_cast<int>(vertices_.size());
      vertices_.push_back(*v);
      core_.push_back(cores.core[*v]);
    }
    words_ = (size() + 63) / 64;
    rows_.resize(std::size_t(size()) * words_);
    for (int i = 0; i < size(); ++i) {
      ForEachBit(graph.row(vertices_[i]), graph.words_per_row(), [&](int u) {
        const int j = number[u];
        if (j >= 0) rows_[std::size_t(i) * words_ + j / 64] |= Word{1} << j % 64;
      });
    }
  }

  Clique Run() {
    start_ = std::chrono::steady_clock::now();
    const int num_starts = std::min(size(), options_.exact ? 16 : 256);
    for (int v = 0; v < num_starts; ++v) Greedy(v);
    if (options_.exact) {
      for (int v = 0; v < size() && core_[v] >= best_size_ && !stopped_; ++v) Root(v);
    }
    Clique clique;
    clique.proven = options_.exact ? !stopped_ : size() == 0 || core_[0] < best_size_;
    clique.nodes = nodes_;
    for (const int v : best_) clique.vertices.push_back(vertices_[v]);
    std::sort(clique.vertices.begin(), clique.vertices.end());
    return clique;
  }

 private:
  struct Level {
    std::vector<Word> candidates, uncolored, color_class;
    std::vector<int> order, color;
  };

  int size() const { return static_cast<int>(vertices_.size()); }
  const Word* row(int i) const { return &rows_[std::size_t(i) * words_]; }

  void Record(const std::vector<int>& clique) {
    if (static_cast<int>(clique.size()) <= best_size_) return;
    best_ = clique;
    best_size_ = static_cast<int>(clique.size());
  }

  /// Grows a clique from a vertex: of the first 32 candidates the one that leaves the most.
  void Greedy(int v) {
    if (core_[v] < best_size_) return;
    std::vector<int> clique{v};
    std::vector<Word> candidates(row(v), row(v) + words_);
    for (;;) {
      int chosen = -1, most = -1, looked_at = 0;
      for (int w = 0; w < words_ && looked_at < 32; ++w) {
        for (Word word = candidates[w]; word && looked_at < 32; word &= word - 1, ++looked_at) {
          const int u = 64 * w + std::countr_zero(word);
          int count = 0;
          for (int k = 0; k < words_; ++k) count += std::popcount(candidates[k] & row(u)[k]);
          if (count > most) {
            most = count;
            chosen = u;
          }
        }
      }
      if (chosen < 0) break;
      clique.push_back(chosen);
      for (int k = 0; k < words_; ++k) candidates[k] &= row(chosen)[k];
      if (static_cast<int>(clique.size()) + most <= best_size_) return;
    }
    Record(clique);
  }

  /// Cliques of v and vertices before it.
  void Root(int v) {
    const int words = (v + 63) / 64;
    std::vector<Word> candidates(row(v), row(v) + words);
    if (v % 64) candidates[words - 1] &= (Word{1} << v % 64) - 1;
    // Neighbours with too few common neighbours cannot be in a larger clique.
    for (bool changed = true; changed;) {
      changed = false;
      int left = 0;
      ForEachBit(candidates.data(), words, [&](int u) {
        int common = 0;
        for (int k = 0; k < words; ++k) common += std::popcount(candidates[k] & row(u)[k]);
        if (common + 2 <= best_size_) {
          candidates[u / 64] &= ~(Word{1} << u % 64);
          changed = true;
        } else {
          ++left;
        }
      });
      if (left < best_size_) return;
    }
    current_.assign(1, v);
    Expand(candidates.data(), words, 0);
  }

  void Expand(const Word* given, int words, std::size_t depth) {
    ++nodes_;
    if (nodes_ > options_.max_nodes || (nodes_ % 256 == 0 && OutOfTime())) stopped_ = true;
    if (stopped_) return;
    if (depth == levels_.size()) levels_.emplace_back();
    Level& level = levels_[depth];
    level.candidates.assign(given, given + words);
    Color(&level, words, best_size_ - static_cast<int>(current_.size()));
    for (std::size_t k = level.order.size(); k-- > 0 && !stopped_;) {
      if (static_cast<int>(current_.size()) + level.color[k] <= best_size_) return;
      const int v = level.order[k];
      current_.push_back(v);
      Word any = 0;
      level.color_class.resize(words);
      for (int w = 0; w < words; ++w) {
        level.color_class[w] = level.candidates[w] & row(v)[w];
        any |= level.color_class[w];
      }
      if (any) {
        Expand(level.color_class.data(), words, depth + 1);
      } else {
        Record(current_);
      }
      current_.pop_back();
      level.candidates[v / 64] &= ~(Word{1} << v % 64);
    }
  }

  /// Colours the candidates one class of unconnected vertices after the other. Those beyond the
  /// first `enough` classes are listed: only they can begin a larger clique.
  void Color(Level* level, int words, int enough) {
    level->order.clear();
    level->color.clear();
    level->uncolored = level->candidates;
    int first = 0;
    for (int color = 1;; ++color) {
      while (first < words && !level->uncolored[first]) ++first;
      if (first == words) return;
      level->color_class.assign(level->uncolored.begin(), level->uncolored.end());
      for (int w = first; w < words; ++w) {
        while (level->color_class[w]) {
          const int bit = std::countr_zero(level->color_class[w]);
          const int v = 64 * w + bit;
          level->uncolored[w] &= ~(Word{1} << bit);
          level->color_class[w] &= ~(Word{1} << bit);
          for (int k = w; k < words; ++k) level->color_class[k] &= ~row(v)[k];
          if (color > enough) {
            level->order.push_back(v);
            level->color.push_back(color);
          }
        }
      }
    }
  }

  bool OutOfTime() const {
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start_;
    return elapsed.count() > options_.time_limit;
  }

  CliqueOptions options_;
  std::vector<int> vertices_, core_;
  int words_ = 0;
  std::vector<Word> rows_;
  std::deque<Level> levels_;  // A deque keeps references when it grows.
  std::vector<int> current_, best_;
  int best_size_;
  std::int64_t nodes_ = 0;
  bool stopped_ = false;
  std::chrono::steady_clock::time_point start_;
};

}  // namespace

Clique MaximumClique(const ConsistencyGraph& graph, const CliqueOptions& options) {
  internal::Require(options.max_nodes >= 0, "max_nodes: must not be negative");
  internal::Require(options.time_limit >= 0, "time_limit: must not be negative");
  return CliqueSearch(graph, options).Run();
}

}  // namespace prehensile
