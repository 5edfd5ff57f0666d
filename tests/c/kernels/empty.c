/* A library without a kernel. */
int gust_no_kernel(void);

int gust_no_kernel(void)
{
    return 0;
}
