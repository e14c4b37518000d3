/* ∂P/∂F in the stretch frame.
 *
 *   on u_n v_nᵀ               the 3×3 block ψ_nm
 *   on u_i v_jᵀ + u_j v_iᵀ    (p_i - p_j)/(s_i - s_j)
 *   on u_i v_jᵀ - u_j v_iᵀ    (p_i + p_j)/(s_i + s_j)
 *
 * for i < j; the last two are in `plus` and `minus`, in the order of pairs 01, 02, 12.
 */
struct blocks
{
  lanes h[3][3], plus[3], minus[3];
};
static const int pair_first[3] = {0, 0, 1}, pair_second[3] = {1, 2, 2};
#define PAIRS (DIM == 2 ? 1 : 3)

/* The mean of (ψ_ii + ψ_jj)/2 - sign ψ_ij over the segment that ends at s and at s with i and j exchanged (sign +1),
 * or exchanged and negated (sign -1): it is the divided difference, without its cancellation. By that symmetry
 * half of the segment suffices. */
static inline lanes end_value(const struct jet *jet, int i, int j, double sign)
{
  return 0.5 * (jet->h[i][i] + jet->h[j][j]) - sign * jet->h[i][j];
}

static lanes inner_value(const struct frame *f, const double *c, int i, int j, double sign, lanes t, mask wanted)
{
  struct jet jet = {0};
  const lanes middle = 0.5 * (f->s[i] + sign * f->s[j]), half = 0.5 * (f->s[i] - sign * f->s[j]);
  lanes s[3] = {f->s[0], f->s[1], f->s[2]};
  s[i] = middle + t * half;
  s[j] = sign * (middle - t * half);
  density_ph(s, f->s, c, wanted, &jet);
  return end_value(&jet, i, j, sign);
}

#if EXTENDED
/* The second derivatives have a kink at σ_f: Gauss points on either side of it. */
static lanes inner_mean(const struct frame *f, const double *c, int i, int j, double sign, lanes end, mask wanted)
{
  (void)end;
  const lanes middle = 0.5 * (f->s[i] + f->s[j]), half = magnitude(0.5 * (f->s[i] - f->s[j]));
  const lanes distance = magnitude(c[THRESHOLD] - middle);
  const lanes kink = choose(distance < half, distance / larger(half, all(DBL_MIN)), all(1));
  const struct rule *rule = &rules[2];
  lanes mean = all(0);
  for (int n = 0; n < rule->points; ++n)
  {
    mean += kink * rule->weight[n] * inner_value(f, c, i, j, sign, kink * rule->t[n], wanted);
    if (any(kink < 1))
      mean += (1 - kink) * rule->weight[n] * inner_value(f, c, i, j, sign, kink + (1 - kink) * rule->t[n], wanted);
  }
  return mean;
}
#else
/* Gauss-Lobatto with six points, four of them inside. */
static lanes inner_mean(const struct frame *f, const double *c, int i, int j, double sign, lanes end, mask wanted)
{
  return end / 15 + 0.55485837703548635302 * inner_value(f, c, i, j, sign, all(0.28523151648064509632), wanted) +
         0.3784749562978469803 * inner_value(f, c, i, j, sign, all(0.76505532392946469285), wanted);
}
#endif

/* Half the gap between two stretches over their mean: up to the first both ends of the segment serve for all of it,
 * up to the second rules of high order are exact, and beyond it the quotient loses no more than two digits. */
#define EQUAL_GAP (EXTENDED ? 1e-13 : 5e-8)
#define SMALL_GAP 1e-2

/* (p_i - sign p_j) / (s_i - sign s_j) with `gap` the exact denominator. */
static inline lanes divided_difference(const struct frame *f, const struct jet *jet, const double *c, int i, int j,
                                       double sign, lanes gap)
{
  /* What the second derivatives vary over: without singularities a stretch of one, else the stretches. */
  const lanes scale = larger(all(SMALLEST_SCALE), magnitude(f->s[i]) + magnitude(f->s[j]));
  const lanes size = magnitude(gap);
  const lanes quotient = (jet->p[i] - sign * jet->p[j]) / choose(size > DBL_MIN, gap, all(1));
  const lanes end = end_value(jet, i, j, sign);
  const mask equal = size <= EQUAL_GAP * scale, close = size <= SMALL_GAP * scale;
  lanes result = choose(equal, end, quotient);
  const mask between = close & (equal == 0);
  if (any(between))
    result = choose(between, inner_mean(f, c, i, j, sign, end, between), result);
  return result;
}

static inline void tangent_blocks(const struct frame *f, const double *c, struct blocks *b)
{
  struct jet jet;
  density_ph(f->s, f->s, c, all(0) == all(0), &jet);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      b->h[i][j] = jet.h[i][j];
  for (int r = 0; r < PAIRS; ++r)
  {
    const int i = pair_first[r], j = pair_second[r];
    const lanes gap = choose(f->small, f->e[i] - f->e[j], f->s[i] - f->s[j]);
    b->plus[r] = divided_difference(f, &jet, c, i, j, 1, gap);
#if !OBJECTIVE
    b->minus[r] = all(0);
#elif EVEN
    b->minus[r] = divided_difference(f, &jet, c, i, j, -1, f->s[i] + f->s[j]);
#else
    /* ψ is odd in single stretches: the tangent has a pole at s_i = -s_j, and is kept finite there. */
    const lanes gap2 = f->s[i] + f->s[j];
    const lanes least = 1e-10 * (1 + magnitude(f->s[i]) + magnitude(f->s[j]));
    b->minus[r] = (jet.p[i] + jet.p[j]) /
                  choose(magnitude(gap2) > least, gap2, choose(gap2 < 0, -least, least));
#endif
  }
}
