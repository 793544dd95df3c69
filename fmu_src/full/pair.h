/* Two doubles that go the same way, as those of both axes do. A compiler that has vectors takes both in one instruction; each is rounded as if
   alone, so that the bits are those of doubles. */

#ifndef GYRO_PAIR_H
#define GYRO_PAIR_H

#if defined(__GNUC__)
#define GYRO_INLINE inline __attribute__((always_inline))
#else
#define GYRO_INLINE inline
#endif

#if defined(__GNUC__) && !defined(GYRO_NO_VECTORS)

#define GYRO_PAIR_VECTORS 1

#define GYRO_BOTH(a) {(a), (a)} /* a constant */
typedef double gyro_pair __attribute__((vector_size(16)));
typedef long long gyro_pair_bits __attribute__((vector_size(16)));
static inline gyro_pair pair_of(double a, double b) { return (gyro_pair){a, b}; }
static inline double lane_of(gyro_pair a, int lane) { return a[lane]; }
static inline gyro_pair pair_sum(gyro_pair a, gyro_pair b) { return a + b; }
static inline gyro_pair pair_difference(gyro_pair a, gyro_pair b) { return a - b; }
static inline gyro_pair pair_product(gyro_pair a, gyro_pair b) { return a * b; }
static inline gyro_pair pair_ratio(gyro_pair a, gyro_pair b) { return a / b; }
static inline gyro_pair pair_size(gyro_pair a) { return (gyro_pair)((gyro_pair_bits)a & (gyro_pair_bits){0x7fffffffffffffffLL, 0x7fffffffffffffffLL}); }

#else

#define GYRO_BOTH(a) {{(a), (a)}}
typedef struct {
    double lane[2];
} gyro_pair;
static inline gyro_pair pair_of(double a, double b)
{
    const gyro_pair pair = {{a, b}};
    return pair;
}
static inline double lane_of(gyro_pair a, int lane) { return a.lane[lane]; }
static inline gyro_pair pair_sum(gyro_pair a, gyro_pair b) { return pair_of(a.lane[0] + b.lane[0], a.lane[1] + b.lane[1]); }
static inline gyro_pair pair_difference(gyro_pair a, gyro_pair b) { return pair_of(a.lane[0] - b.lane[0], a.lane[1] - b.lane[1]); }
static inline gyro_pair pair_product(gyro_pair a, gyro_pair b) { return pair_of(a.lane[0] * b.lane[0], a.lane[1] * b.lane[1]); }
static inline gyro_pair pair_ratio(gyro_pair a, gyro_pair b) { return pair_of(a.lane[0] / b.lane[0], a.lane[1] / b.lane[1]); }
static inline gyro_pair pair_size(gyro_pair a) { return pair_of(fabs(a.lane[0]), fabs(a.lane[1])); }

#endif

static inline gyro_pair both(double a) { return pair_of(a, a); }
static inline gyro_pair pair_scaled(double f, gyro_pair a) { return pair_product(both(f), a); }
static inline gyro_pair pair_negative(gyro_pair a) { return pair_scaled(-1.0, a); }
static inline gyro_pair pair_exchanged(gyro_pair a) { return pair_of(lane_of(a, 1), lane_of(a, 0)); }
static inline int is_both(gyro_pair a, double c) { return lane_of(a, 0) == c && lane_of(a, 1) == c; }
static inline int is_zero(gyro_pair a) { return is_both(a, 0.0); }

/* The first of a pair for one axis, nothing for the other. */
static inline gyro_pair on_axis(int axis, gyro_pair a) { return axis == 0 ? pair_of(lane_of(a, 0), 0.0) : pair_of(0.0, lane_of(a, 0)); }

#endif
