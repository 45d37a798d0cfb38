#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace prehensile {

/// Chooses points that are far from each other: the next one is always that which is farthest from
/// all chosen so far, of several the one with the smallest index (Eldar et al., "The farthest point
/// strategy for progressive image sampling", 1997).
///
/// @param points n rows of x, y, z.
/// @param count how many to choose, at most n.
/// @param start the first one.
/// @param indices room for count.
/// @param distances room for count: how far each was from those before it; infinity for the first.
/// @throws std::invalid_argument if a coordinate is not finite, count or start is out of range, or
///     n ≥ 2³¹.
void FarthestPoints(const double* points, std::size_t n, std::size_t count, std::size_t start,
                    std::int32_t* indices, double* distances);

/// Thins points out until so many are left that are spread evenly over the surface that they lie on
/// (Yuksel, "Sample elimination for generating Poisson disk sample sets", 2015): the one that is
/// most crowded goes first.
///
/// @param points n rows of x, y, z, several times as many as are to be left.
/// @param count how many to leave, 1 to n.
/// @param radius how far points crowd each other: the distance of neighbours in the hexagonal
///     pattern of `count` points on an area as large. Positive.
/// @return the indices of those left, ascending.
/// @throws std::invalid_argument if an argument is out of range or not finite.
std::vector<std::int32_t> EliminateSamples(const double* points, std::size_t n, std::size_t count,
                                           double radius);

/// Goes through the points in order and keeps each that is at least so far from all kept before.
///
/// @return the indices of those kept, ascending.
/// @throws std::invalid_argument if a coordinate is not finite, n ≥ 2³¹, or the radius is not
///     positive and finite.
std::vector<std::int32_t> KeepApart(const double* points, std::size_t n, double radius);

}  // namespace prehensile
